// SPDX-License-Identifier: Apache-2.0
#include "sensors/imu/mti_can.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

namespace takt::sensors {
namespace {

constexpr std::uint32_t kStandardIds = 0x7FF, kExtendedIds = 0x1FFF'FFFF;
constexpr std::array<std::string_view, 4> kQuantities{"Group Counter", "Quaternion", "Rate of Turn", "Acceleration"};
constexpr std::array<std::uint8_t, 4> kLengths{2, 8, 6, 6};
constexpr double kUnitless = 1.0 / (1 << 15), kRadiansPerSecond = 1.0 / (1 << 9), kMetresPerSecond2 = 1.0 / (1 << 8);

std::uint16_t big_endian(const std::uint8_t* bytes) {
  return static_cast<std::uint16_t>(bytes[0] << 8 | bytes[1]);
}

template <std::size_t Count>
std::array<double, Count> scaled(const drivers::CanFrame& frame, double unit) {
  std::array<double, Count> values{};
  for (std::size_t i = 0; i < Count; ++i) values[i] = unit * static_cast<std::int16_t>(big_endian(frame.data + 2 * i));
  return values;
}

std::optional<config::IdPattern> parse_id(std::string_view text) {
  if (!text.starts_with("0x")) return std::nullopt;
  text.remove_prefix(2);
  std::uint32_t id = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id, 16);
  const bool extended = text.size() > 3;
  const std::uint32_t most = extended ? kExtendedIds : kStandardIds;
  if (error != std::errc{} || end != text.data() + text.size() || id > most) return std::nullopt;
  return config::IdPattern{id, most, extended};
}

std::string listed(const MtCanIds& ids, const std::bitset<4>& which) {
  std::string all;
  for (std::size_t i = 0; i < ids.size(); ++i)
    if (which[i]) all += fmt::format("{}{} ({})", all.empty() ? "" : ", ", kQuantities[i], text_of(ids[i]));
  return all;
}

}  // namespace

std::string text_of(const config::IdPattern& id) {
  return id.extended ? fmt::format("0x{:08X}", id.id) : fmt::format("0x{:03X}", id.id);
}

std::expected<MtCanIds, std::string> parse_mt_can_ids(const std::string& text) {
  const auto wrong = [&text] {
    return std::unexpected(
        fmt::format("{}: four ids, as 0x006,0x021,0x032,0x034: Group Counter, Quaternion, Rate of Turn, Acceleration, "
                    "of which the first goes first on the bus, so that it is the lowest",
                    text));
  };
  MtCanIds ids;
  std::string_view rest = text;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const std::size_t comma = rest.find(',');
    if ((comma == std::string_view::npos) != (i + 1 == ids.size())) return wrong();
    const auto id = parse_id(rest.substr(0, comma));
    if (!id) return wrong();
    ids[i] = *id;
    if (comma != std::string_view::npos) rest.remove_prefix(comma + 1);
  }
  for (std::size_t i = 0; i < ids.size(); ++i)
    for (std::size_t j = i + 1; j < ids.size(); ++j)
      if (overlap(ids[i], ids[j]) || ids[i].extended != ids[j].extended) return wrong();
  if (std::ranges::any_of(ids, [&ids](const auto& id) { return id.id < ids[0].id; })) return wrong();
  return ids;
}

std::optional<MtCanSample> MtCanGroups::take(const drivers::ReceivedFrame& received) {
  const drivers::CanFrame& frame = received.frame;
  const auto found =
      std::ranges::find_if(ids_, [&frame](const auto& id) { return id.matches(frame.id, frame.extended); });
  const auto quantity = static_cast<std::size_t>(found - ids_.begin());
  if (found == ids_.end() || frame.remote || frame.length < kLengths[quantity]) return std::nullopt;
  seen_.set(quantity);
  if (quantity == kCounter) {
    begin(received);
    return std::nullopt;
  }
  if (!group_ || in_group_[quantity]) return std::nullopt;  // of a group whose counter was lost, or said twice
  in_group_.set(quantity);
  fill(quantity, frame);
  group_->first_frame_at = std::min(group_->first_frame_at, received.received_at);
  if (!in_group_.all()) return std::nullopt;
  const MtCanSample whole = *group_;
  group_.reset();
  return whole;
}

void MtCanGroups::begin(const drivers::ReceivedFrame& counter) {
  if (group_) ++incomplete_;
  group_ = MtCanSample{.sample = {.counter = big_endian(counter.frame.data)}, .first_frame_at = counter.received_at};
  in_group_.reset().set(kCounter);
}

void MtCanGroups::fill(std::size_t quantity, const drivers::CanFrame& frame) {
  MtSample& sample = group_->sample;
  if (quantity == kRotation) sample.rotation = scaled<4>(frame, kUnitless);
  if (quantity == kRate) sample.angular_velocity = scaled<3>(frame, kRadiansPerSecond);
  if (quantity == kAcceleration) sample.acceleration = scaled<3>(frame, kMetresPerSecond2);
}

std::string MtCanGroups::why_none() const {
  if (seen_.none()) return "no frame of an MTi comes: is it connected, in measurement mode, and are these its ids?";
  if (!seen_.all())
    return fmt::format("of an MTi come {}; have MT Manager send {} too", listed(ids_, seen_), listed(ids_, ~seen_));
  return "an MTi's frames come, but no group of them is whole: all four have to be sent at one rate";
}

bool GravityCheck::take(const MtSample& sample) {
  if (settled_) return true;
  const auto& [w, x, y, z] = sample.rotation;
  const auto& a = sample.acceleration;
  sum_ += 2 * (x * z - w * y) * a[0] + 2 * (y * z + w * x) * a[1] + (1 - 2 * (x * x + y * y)) * a[2];
  if (++samples_ < kSamples) return false;
  const double mean = sum_ / samples_;
  samples_ = 0;
  sum_ = 0;
  settled_ = mean > kClear;
  if (settled_)
    doubt_.clear();
  else if (mean < -kClear)
    doubt_ = "the MTi's z axis points down (NED): choose ENU or NWU in MT Manager";
  else
    doubt_ =
        fmt::format("the MTi's acceleration is {:.1f} m/s2 upwards in its own world, and should be about 9.8", mean);
  return settled_;
}

}  // namespace takt::sensors
