// SPDX-License-Identifier: Apache-2.0
#include "simulation/cia402_objects.hpp"

#include <cmath>
#include <string>

namespace takt::simulation {
namespace {

constexpr std::uint8_t kMapEntries = 4;
constexpr std::uint32_t kPdoOff = 0x8000'0000, kNoRemote = 0x4000'0000, kExtendedId = 0x2000'0000;

std::uint32_t key(std::uint16_t index, std::uint8_t sub) {
  return std::uint32_t{index} << 8U | sub;
}

bool within(std::uint16_t index, std::uint16_t from, std::uint16_t to) {
  return index >= from && index <= to;
}
bool is_map(std::uint16_t index) {
  return within(index, 0x1600, 0x17FF) || within(index, 0x1A00, 0x1BFF);
}
bool is_transmit(std::uint16_t index) {
  return within(index, 0x1800, 0x1BFF);
}

MappedObject unpack(std::uint32_t mapping) {
  return {static_cast<std::uint16_t>(mapping >> 16U), static_cast<std::uint8_t>(mapping >> 8U & 0xFFU),
          (mapping & 0xFFU) / 8};
}

// VENDOR:PRODUCT or VENDOR:PRODUCT:SERIAL, and the revision, as the robot file wants them.
void take_identity(const config::Drive& drive, Cia402Profile& profile) {
  constexpr std::size_t kDigits = 8;
  const auto word = [](const std::string& digits, std::size_t place) {
    return static_cast<std::uint32_t>(std::stoul(digits.substr(place * kDigits, kDigits), nullptr, 16));
  };
  std::string digits = drive.identity;
  std::erase(digits, ':');
  if (digits.size() >= 2 * kDigits) {
    profile.identity[0] = word(digits, 0);
    profile.identity[1] = word(digits, 1);
  }
  if (digits.size() == 3 * kDigits) profile.identity[3] = word(digits, 2);
  if (drive.firmware.size() == kDigits) profile.identity[2] = word(drive.firmware, 0);
}

}  // namespace

Cia402Profile profile_of(const config::Drive& drive) {
  constexpr std::uint32_t kCounts = 0x00B5'0000, kCountsPerSecond = 0x00B5'0300, kRpm = 0x00B4'4700,
                          kTenth = 0xFF00'0000, kHundredth = 0xFE00'0000, kThousandth = 0xFD00'0000;
  Cia402Profile profile;
  take_identity(drive, profile);
  profile.encoder = profile.feed = {drive.counts_per_turn, 1};
  profile.gear = {1, 1};
  profile.position_unit = kCounts;
  const auto counts = [&profile](double speed_counts, std::uint32_t unit) {
    profile.speed_counts = speed_counts;
    profile.velocity_unit = unit;
    return profile;
  };
  switch (drive.velocity_unit) {
    case config::Cia402VelocityUnit::counts_per_s:
      return counts(0, kCountsPerSecond);
    case config::Cia402VelocityUnit::rpm:
      return counts(60, kRpm);
    case config::Cia402VelocityUnit::tenth_rpm:
      return counts(600, kRpm | kTenth);
    case config::Cia402VelocityUnit::hundredth_rpm:
      return counts(6'000, kRpm | kHundredth);
    case config::Cia402VelocityUnit::thousandth_rpm:
      return counts(60'000, kRpm | kThousandth);
  }
  return profile;
}

Cia402Objects::Cia402Objects(const config::Drive& drive, std::uint16_t deadline_ms, const Cia402Profile& profile) {
  using Use = ObjectEntry::Use;
  const std::uint32_t node = drive.id;
  const auto add = [this](std::uint16_t index, std::uint8_t sub, unsigned bytes, Use use, std::uint32_t value = 0) {
    power_on_[key(index, sub)] = {bytes, value, use};
  };
  const auto add_pdo = [&add, &profile](std::uint16_t communication, std::uint32_t cob_id, std::uint32_t first_object) {
    const auto map = static_cast<std::uint16_t>(communication + 0x200);
    add(communication, 0, 1, Use::constant, profile.has_deadline ? 5 : 2);
    add(communication, 1, 4, Use::setting, cob_id);
    add(communication, 2, 1, Use::setting, 255);
    if (profile.has_deadline) add(communication, 5, 2, Use::setting);
    add(map, 0, 1, Use::setting, 1);
    for (std::uint8_t entry = 1; entry <= kMapEntries; ++entry)
      add(map, entry, 4, Use::setting, entry == 1 ? first_object : 0);
  };
  add(0x1000, 0, 4, Use::constant, 0x0002'0192);  // servo drive of profile 402
  add(0x1001, 0, 1, Use::from_drive);
  if (profile.has_heartbeat_watch) {
    add(0x1016, 0, 1, Use::constant, 1);
    add(0x1016, 1, 4, Use::setting);
    add(0x6007, 0, 2, Use::setting);
  }
  add(0x1017, 0, 2, Use::setting);
  if (profile.identity_entries > 0) add(0x1018, 0, 1, Use::constant, profile.identity_entries);
  for (std::uint8_t sub = 1; sub <= profile.identity_entries; ++sub)
    add(0x1018, sub, 4, Use::constant, profile.identity.at(sub - 1U));
  // By default the PDOs exist, with the control- and statusword alone.
  add_pdo(0x1400, 0x200 + node, 0x6040'0010);
  if (profile.has_second_pdos) add_pdo(0x1401, 0x300 + node, 0x6040'0010);
  add_pdo(0x1800, kNoRemote + 0x180 + node, 0x6041'0010);
  if (profile.has_second_pdos) add_pdo(0x1801, kNoRemote + 0x280 + node, 0x6041'0010);
  if (profile.has_deadline) power_on_[key(0x1400, 5)].value = deadline_ms;
  add(0x603F, 0, 2, Use::from_drive);
  add(0x6040, 0, 2, Use::to_drive);
  add(0x6041, 0, 2, Use::from_drive);
  add(0x6060, 0, 1, Use::to_drive);
  add(0x6061, 0, 1, Use::from_drive);
  add(0x6064, 0, 4, Use::from_drive);
  add(0x606C, 0, 4, Use::from_drive);
  add(0x6071, 0, 2, Use::to_drive);
  if (profile.has_following_window) {
    add(0x6065, 0, 4, Use::setting, 0xFFFF'FFFF);
    add(0x6066, 0, 2, Use::setting);
  }
  if (profile.has_max_torque) add(0x6072, 0, 2, Use::setting, 3000);
  add(0x6076, 0, 4, Use::constant, static_cast<std::uint32_t>(std::llround(drive.rated_torque * 1000)));
  add(0x6077, 0, 2, Use::from_drive);
  add(0x607A, 0, 4, Use::to_drive);
  add(0x60C2, 0, 1, Use::constant, 2);
  add(0x60C2, 1, 1, Use::setting, 1);
  add(0x60C2, 2, 1, Use::setting, 0xFD);
  const auto add_ratio = [&add](std::uint16_t index, const std::optional<Cia402Profile::Ratio>& ratio) {
    if (!ratio) return;
    add(index, 0, 1, Use::constant, 2);
    add(index, 1, 4, Use::constant, ratio->front());
    add(index, 2, 4, Use::constant, ratio->back());
  };
  add_ratio(0x608F, profile.encoder);
  add_ratio(0x6091, profile.gear);
  add_ratio(0x6092, profile.feed);
  if (profile.position_unit) add(0x60A8, 0, 4, Use::constant, *profile.position_unit);
  if (profile.velocity_unit) add(0x60A9, 0, 4, Use::constant, *profile.velocity_unit);
  add(0x60FF, 0, 4, Use::to_drive);
  add(0x6502, 0, 4, Use::constant, profile.modes);
  if (profile.map != Cia402Profile::Map::free) fix_maps(drive, profile);
  reset();
}

// As delivered, and not to be written.
void Cia402Objects::fix_maps(const config::Drive& drive, const Cia402Profile& profile) {
  const auto target = [&drive]() -> std::uint32_t {
    switch (drive.mode) {
      case config::Cia402Mode::csp:
        return 0x607A'0020;
      case config::Cia402Mode::csv:
        return 0x60FF'0020;
      case config::Cia402Mode::cst:
        return 0x6071'0010;
    }
    return 0;
  };
  const bool whole = profile.map == Cia402Profile::Map::fixed;
  const std::vector<std::uint32_t> words{whole ? 3U : 1U, 0x6040'0010, 0x6060'0008, target(), 0},
      reports{whole ? 3U : 1U, 0x6041'0010, 0x6064'0020, 0x6077'0010, 0};
  for (std::uint8_t sub = 0; sub <= kMapEntries; ++sub) {
    ObjectEntry& receive = power_on_[key(0x1600, sub)];
    ObjectEntry& transmit = power_on_[key(0x1A00, sub)];
    receive.use = transmit.use = ObjectEntry::Use::constant;
    receive.value = words[sub];
    transmit.value = reports[sub];
  }
}

bool Cia402Objects::has(std::uint16_t index, std::uint8_t sub) const {
  return entries_.contains(key(index, sub));
}

void Cia402Objects::reset() {
  entries_ = power_on_;
}

void Cia402Objects::reset_communication() {
  for (const auto& [where, entry] : power_on_)
    if (where < key(0x2000, 0)) entries_[where] = entry;
}

SdoAbort Cia402Objects::why_not_readable(std::uint16_t index, std::uint8_t sub) const {
  if (entries_.contains(key(index, sub))) return SdoAbort::none;
  const auto next = entries_.lower_bound(key(index, 0));
  const bool index_exists = next != entries_.end() && next->first >> 8U == index;
  return index_exists ? SdoAbort::no_such_sub_index : SdoAbort::no_such_object;
}

SdoAbort Cia402Objects::write(std::uint16_t index, std::uint8_t sub, std::uint32_t value, unsigned bytes,
                              bool operational) {
  if (const SdoAbort why = why_not_readable(index, sub); why != SdoAbort::none) return why;
  ObjectEntry& entry = entries_[key(index, sub)];
  if (!entry.writable()) return SdoAbort::read_only;
  if (bytes != 0 && bytes != entry.bytes) return SdoAbort::wrong_length;
  if (operational && within(index, 0x1400, 0x1BFF)) return SdoAbort::device_state;
  if (const SdoAbort why = check(index, sub, value); why != SdoAbort::none) return why;
  entry.value = value;
  return SdoAbort::none;
}

const ObjectEntry& Cia402Objects::at(std::uint16_t index, std::uint8_t sub) const {
  return entries_.at(key(index, sub));
}

void Cia402Objects::set(std::uint16_t index, std::uint8_t sub, std::uint32_t value) {
  entries_.at(key(index, sub)).value = value;
}

bool Cia402Objects::pdo_exists(std::uint16_t communication) const {
  return (value(communication, 1) & kPdoOff) == 0;
}

std::uint32_t Cia402Objects::pdo_id(std::uint16_t communication) const {
  return value(communication, 1) & 0x7FFU;
}

std::vector<MappedObject> Cia402Objects::pdo_map(std::uint16_t communication) const {
  const auto map = static_cast<std::uint16_t>(communication + 0x200);
  std::vector<MappedObject> objects;
  const auto count = static_cast<std::uint8_t>(value(map, 0));
  for (std::uint8_t entry = 1; entry <= count; ++entry) objects.push_back(unpack(value(map, entry)));
  return objects;
}

SdoAbort Cia402Objects::check(std::uint16_t index, std::uint8_t sub, std::uint32_t value) const {
  const auto in_range = [](bool yes) { return yes ? SdoAbort::none : SdoAbort::out_of_range; };
  if (is_map(index)) return check_map(index, sub, value);
  if (within(index, 0x1400, 0x1BFF)) {
    if (sub == 1) return check_cob_id(index, value);
    return in_range(sub != 2 || value <= 240 || value >= 252);
  }
  if (index == 0x6060) return in_range(value >= 8 && value <= 10);
  if (index == 0x60C2) return in_range(sub == 1 ? value >= 1 : value == 0 || value >= 0xFA);
  return SdoAbort::none;
}

SdoAbort Cia402Objects::check_cob_id(std::uint16_t index, std::uint32_t value) const {
  const std::uint32_t id = value & 0x1FFF'FFFF;
  if ((value & kExtendedId) != 0 || id == 0 || id > 0x7FF) return SdoAbort::out_of_range;
  if (is_transmit(index) && (value & kNoRemote) == 0) return SdoAbort::out_of_range;
  const bool stays = pdo_exists(index) && (value & kPdoOff) == 0;
  return stays && id != pdo_id(index) ? SdoAbort::out_of_range : SdoAbort::none;
}

SdoAbort Cia402Objects::check_map(std::uint16_t index, std::uint8_t sub, std::uint32_t value) const {
  if (pdo_exists(static_cast<std::uint16_t>(index - 0x200))) return SdoAbort::unsupported_access;
  if (sub == 0) return check_count(index, value);
  if (this->value(index, 0) != 0) return SdoAbort::unsupported_access;
  return check_entry(index, value);
}

SdoAbort Cia402Objects::check_entry(std::uint16_t index, std::uint32_t mapping) const {
  const MappedObject object = unpack(mapping);
  if (why_not_readable(object.index, object.sub) != SdoAbort::none) return SdoAbort::not_mappable;
  const ObjectEntry& entry = at(object.index, object.sub);
  const auto wanted = is_transmit(index) ? ObjectEntry::Use::from_drive : ObjectEntry::Use::to_drive;
  const bool fits = entry.use == wanted && (mapping & 0xFFU) == entry.bytes * 8;
  return fits ? SdoAbort::none : SdoAbort::not_mappable;
}

SdoAbort Cia402Objects::check_count(std::uint16_t index, std::uint32_t count) const {
  if (count > kMapEntries) return SdoAbort::out_of_range;
  unsigned bytes = 0;
  for (std::uint32_t entry = 1; entry <= count; ++entry) {
    const std::uint32_t mapping = value(index, static_cast<std::uint8_t>(entry));
    if (check_entry(index, mapping) != SdoAbort::none) return SdoAbort::not_mappable;
    bytes += unpack(mapping).bytes;
  }
  return bytes > 8 ? SdoAbort::map_too_long : SdoAbort::none;
}

}  // namespace takt::simulation
