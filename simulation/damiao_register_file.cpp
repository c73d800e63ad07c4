// SPDX-License-Identifier: Apache-2.0
#include "simulation/damiao_register_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <string>

namespace takt::simulation {
namespace {

constexpr std::int64_t kTimeoutUnit_ns = 50'000;
constexpr std::uint32_t kMitMode = 1;

std::uint32_t number_or(const std::string& text, std::uint32_t otherwise) {
  return text.empty() || text == "any" ? otherwise : static_cast<std::uint32_t>(std::stoul(text));
}

std::uint32_t float_bits(double value) {
  return std::bit_cast<std::uint32_t>(static_cast<float>(value));
}

// The maker's numbering, of 125 kbit/s to 5 Mbit/s in ten steps; classic drives run at 1 Mbit/s.
std::uint32_t bit_rate_code(std::uint32_t bits_per_s) {
  constexpr std::array<std::uint32_t, 10> kRates{125'000,   200'000,   250'000,   500'000,   1'000'000,
                                                 2'000'000, 2'500'000, 3'200'000, 4'000'000, 5'000'000};
  const auto found = std::ranges::find(kRates, bits_per_s == 0 ? 1'000'000 : bits_per_s);
  return static_cast<std::uint32_t>(found - kRates.begin());
}

}  // namespace

DamiaoRegisterFile::DamiaoRegisterFile(const config::Drive& drive, Duration watchdog) {
  present_[kTimeout] = static_cast<std::uint32_t>(watchdog.ns / kTimeoutUnit_ns);
  present_[kControlMode] = kMitMode;
  present_[kHardware] = 21;
  present_[kFirmware] = number_or(drive.firmware, 5013);
  present_[kSerialNumber] = number_or(drive.identity, 70'000 + drive.id);
  present_[kPositionMax] = float_bits(drive.position_range);
  present_[kVelocityMax] = float_bits(drive.velocity_range);
  present_[kTorqueMax] = float_bits(drive.torque_range);
  present_[kBitRate] = bit_rate_code(drive.fd_bitrate);
  stored_ = present_;
  take_effect();
}

void DamiaoRegisterFile::restart() {
  present_ = stored_;
  take_effect();
}

void DamiaoRegisterFile::take_effect() {
  const auto word = [this](std::uint8_t number) { return present_.at(number).value(); };
  const auto value = [&](std::uint8_t number) { return double{std::bit_cast<float>(word(number))}; };
  spans_ = {value(kPositionMax), value(kVelocityMax), value(kTorqueMax)};
  watchdog_ = {word(kTimeout) * kTimeoutUnit_ns};
  is_in_mit_mode_ = word(kControlMode) == kMitMode;
}

bool DamiaoRegisterFile::serve(std::span<const std::uint8_t, 8> order, bool enabled,
                               std::span<std::uint8_t, 8> answer) {
  std::ranges::copy(order, answer.begin());
  const std::uint8_t operation = order[2];
  if (operation == kStore) {
    if (!enabled) stored_ = present_;
    return !enabled;
  }
  const std::size_t number = order[3];
  if (number >= present_.size() || !present_[number] || (operation != kRead && operation != kWrite)) return false;
  std::uint32_t& word = *present_[number];
  if (operation == kWrite) {
    if (enabled) return false;
    word = 0;
    for (std::size_t i = 0; i < 4; ++i) word += std::uint32_t{order[4 + i]} << 8 * i;
    take_effect();
  }
  for (std::size_t i = 0; i < 4; ++i) answer[4 + i] = static_cast<std::uint8_t>(word >> 8 * i & 0xFFU);
  return true;
}

}  // namespace takt::simulation
