// SPDX-License-Identifier: Apache-2.0
#include "commissioning/cia402_scale.hpp"

#include <cmath>
#include <cstdio>
#include <numbers>
#include <utility>

#include "drivers/protocol/cia402/cia402_codec.hpp"

namespace takt::commissioning {
namespace {

constexpr std::array<drivers::cia402::ObjectId, 9> kObjects{{{0x608F, 1},
                                                             {0x608F, 2},
                                                             {0x6091, 1},
                                                             {0x6091, 2},
                                                             {0x6092, 1},
                                                             {0x6092, 2},
                                                             {0x60A8, 0},
                                                             {0x60A9, 0},
                                                             {0x606C, 0}}};
constexpr double kSame = 0.005;      // share
constexpr double kFewestUnits = 60;  // per turn: fewer are no unit to move in, but numbers as delivered

// A unit of CiA 402: power of ten, unit, per which time, reserved.
enum class Unit : std::uint8_t { none = 0x00, turn = 0xB4, count = 0xB5 };
constexpr std::uint32_t kSecond = 0x03, kMinute = 0x47;
Unit unit_of(std::uint32_t word) {
  return static_cast<Unit>(word >> 16U & 0xFFU);
}
double power_of(std::uint32_t word) {
  return std::pow(10.0, static_cast<std::int8_t>(word >> 24U));
}

bool same(double a, double b) {
  return std::abs(a - b) <= kSame * std::abs(b);
}

std::string ten_digits(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.10g", value);
  return text.data();
}

OwnScale not_judged(const std::string& why) {
  return {.sentence = "counts_per_turn is not judged: " + why};
}

}  // namespace

std::optional<drivers::CanFrame> Cia402Scale::ask(bool moves, MonoTime now) {
  if (asked_at_.is_set() && now - asked_at_ < kAnswerWithin) return std::nullopt;
  if (!asked() && tries_ == kTries) {
    ++next_;
    tries_ = 0;
  }
  if (asked() && !moves) return std::nullopt;
  ++tries_;
  asked_at_ = now;
  return drivers::cia402::encode_sdo_read(drive_.id, kObjects.at(next_));
}

void Cia402Scale::take(const drivers::CanFrame& frame) {
  if (!asked_at_.is_set() || frame.id != drivers::cia402::kSdoAnswerId + drive_.id) return;
  const auto answer = drivers::cia402::decode_sdo_answer(frame);
  if (!answer || answer->object != kObjects.at(next_)) return;
  asked_at_ = {};
  const bool is_value = answer->kind == drivers::cia402::SdoAnswer::Kind::value;
  if (asked()) {
    if (is_value) velocity_ = velocity_of(static_cast<std::int32_t>(answer->value));
    return;
  }
  if (is_value) told_.at(next_) = answer->value;
  ++next_;
  tries_ = 0;
}

std::optional<double> Cia402Scale::take_velocity() {
  return std::exchange(velocity_, std::nullopt);
}

bool Cia402Scale::knows_velocity_unit() const {
  const auto& word = told_[kVelocityUnit];
  if (!word) return false;
  const std::uint32_t time = *word >> 8U & 0xFFU;
  const Unit unit = unit_of(*word);
  return (time == kSecond || time == kMinute) && (unit == Unit::turn || unit == Unit::count);
}

double Cia402Scale::velocity_of(std::int32_t counts) const {
  const double by_counts = counts * 2 * std::numbers::pi / static_cast<double>(drive_.counts_per_turn);
  if (!knows_velocity_unit()) return by_counts;
  const std::uint32_t word = *told_[kVelocityUnit];
  const double per_second = power_of(word) / ((word >> 8U & 0xFFU) == kMinute ? 60 : 1);
  switch (unit_of(word)) {
    case Unit::turn:
      return counts * per_second * 2 * std::numbers::pi;
    case Unit::none:
    case Unit::count:
      break;
  }
  return by_counts * per_second;
}

// Nothing: untold, or a part of it is 0.
std::optional<double> Cia402Scale::ratio(Which numerator, Which denominator) const {
  const auto &above = told_.at(numerator), &below = told_.at(denominator);
  if (!above || !below || *above == 0 || *below == 0) return std::nullopt;
  return static_cast<double>(*above) / *below;
}

OwnScale Cia402Scale::judge() const {
  const double gear = ratio(kGearMotor, kGearShaft).value_or(1);
  const auto increments = ratio(kIncrements, kTurns), feed = ratio(kFeed, kFeedShaft);
  const std::uint32_t unit = told_[kPositionUnit].value_or(0);
  double per_shaft = 0;  // units of 6064 per turn of its shaft
  const char* objects = "6092, 6091";
  if (unit_of(unit) == Unit::turn) {
    per_shaft = 1 / power_of(unit);
    objects = "60A8, 6091";
  } else if (unit_of(unit) != Unit::none && unit_of(unit) != Unit::count) {
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "its unit of position (60A8) is %08X", unit);
    return not_judged(text.data());
  } else if (feed && *feed >= kFewestUnits) {
    per_shaft = *feed;
  } else if (increments && gear == 1) {
    per_shaft = *increments;
    objects = "608F";
  } else {
    return not_judged(increments ? "the drive tells a gear of its own (6091) and no units per turn (6092)"
                                 : "the drive tells no encoder (608F) and no units per turn (6092)");
  }
  const auto counts = static_cast<double>(drive_.counts_per_turn);
  const std::string told = ten_digits(per_shaft / gear) + " counts per motor turn (" + objects + ")";
  const bool through_its_gear = gear != 1 && same(counts * drive_.gear_ratio, per_shaft);
  if (through_its_gear || same(counts, per_shaft / gear))
    return {OwnScale::Verdict::right, through_its_gear, "its own scale is the robot file's: " + told};
  return {OwnScale::Verdict::wrong, false,
          "the drive has " + told + ", the robot file says counts_per_turn " + ten_digits(counts) +
              ": the joint moves " + ten_digits(std::round(1000 * counts * gear / per_shaft) / 1000) + " times as far"};
}

}  // namespace takt::commissioning
