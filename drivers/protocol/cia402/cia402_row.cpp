// SPDX-License-Identifier: Apache-2.0
// CiA 402's row of the protocol table: configuration to driver, traffic, names of error codes.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "drivers/protocol/cia402/cia402_driver.hpp"

namespace takt::drivers {
namespace {

bool is_last_of_its_bus(const config::RobotConfig& robot, std::size_t joint) {
  for (std::size_t later = joint + 1; later < robot.joints.size(); ++later)
    if (robot.joints[later].bus == robot.joints[joint].bus &&
        robot.joints[later].drive.protocol == config::DriveProtocol::cia402)
      return false;
  return true;
}

std::uint32_t ticks_in(Duration span, Duration period) {
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>((span.ns + period.ns - 1) / period.ns, 1, 1'000'000));
}

double speed_counts_of(const config::Drive& drive) {
  switch (drive.velocity_unit) {
    case config::Cia402VelocityUnit::counts_per_s:
      return static_cast<double>(drive.counts_per_turn);
    case config::Cia402VelocityUnit::rpm:
      return 60;
    case config::Cia402VelocityUnit::tenth_rpm:
      return 600;
    case config::Cia402VelocityUnit::hundredth_rpm:
      return 6'000;
    case config::Cia402VelocityUnit::thousandth_rpm:
      return 60'000;
  }
  return 1;
}

cia402::Scale scale_of(const config::Drive& drive) {
  return {.mode = drive.mode,
          .counts_per_turn = static_cast<double>(drive.counts_per_turn),
          .speed_counts = speed_counts_of(drive),
          .rated_torque = static_cast<float>(drive.rated_torque)};
}

// What the drive itself is to hold its torque to. Frames hold it to the joint's limit where they say a torque; where
// the drive closes its own loop, this alone does.
std::uint32_t max_torque_per_mille(const config::Joint& joint) {
  const config::Drive& drive = joint.drive;
  const bool frames_say = drive.mode == config::Cia402Mode::cst || joint.limits.torque <= 0;
  const double most =
      frames_say ? drive.torque_range : std::min(drive.torque_range, joint.limits.torque / drive.gear_ratio);
  return static_cast<std::uint32_t>(std::clamp(std::floor(most / drive.rated_torque * 1000 + 1e-6), 1.0, 65'535.0));
}

// Object 6065, where the robot stops for it: as far as the executive lets the joint be behind (pipeline/following.hpp).
std::uint32_t following_window(const config::RobotConfig& robot, const config::Joint& joint) {
  constexpr double kShareOfTorque = 0.9;
  if (robot.feedback.following != config::Following::stop || robot.feedback.following_timeout <= Duration{}) return 0;
  const double by_torque = joint.kp > 0 ? kShareOfTorque * joint.limits.torque / joint.kp : 0;
  const double window = joint.limits.following_error > 0 ? joint.limits.following_error : by_torque;
  const double counts =
      window * joint.drive.gear_ratio * static_cast<double>(joint.drive.counts_per_turn) / (2 * std::numbers::pi);
  return static_cast<std::uint32_t>(std::clamp(std::ceil(counts), 0.0, 2'147'483'647.0));
}

// Object 6066: twice the executive's time-out, whose stop keeps the drive's power.
std::uint16_t following_timeout_ms(const config::RobotConfig& robot) {
  return static_cast<std::uint16_t>(std::clamp(2 * robot.feedback.following_timeout.milliseconds(), 1.0, 65'535.0));
}

const char* wrong_with(const config::Drive& drive) {
  if (drive.id < 1 || drive.id > 126)
    return "cia402 node numbers are 1 to 126 here, 127 being this computer's: correct id";
  if (drive.counts_per_turn == 0) return "counts_per_turn must be positive: the units of object 6064 per motor turn";
  const bool positive = std::isfinite(drive.rated_torque) && drive.rated_torque > 0 &&
                        std::isfinite(drive.torque_range) && drive.torque_range > 0;
  if (!positive) return "rated_torque and torque_range must be positive";
  if (drive.rated_torque > 4e6) return "rated_torque does not fit object 6076, which counts mNm in 32 bits";
  if (drive.torque_range * 1000 < drive.rated_torque)
    return "torque_range is below a thousandth of rated_torque, the drive's smallest torque: check both";
  if (drive.mode == config::Cia402Mode::cst && drive.torque_range * 1000 > drive.rated_torque * cia402::kMostPerMille)
    return "torque_range is beyond what object 6071 can ask for, 32.767 times rated_torque: check both";
  return nullptr;
}

struct NamedCode {
  std::uint32_t code;
  const char* name;
};
constexpr std::array kCodes{
    NamedCode{0x2310, "over-current"},
    NamedCode{0x2350, "overload (I2t)"},
    NamedCode{0x3110, "over-voltage of the supply"},
    NamedCode{0x3120, "under-voltage of the supply"},
    NamedCode{0x3210, "over-voltage of the DC link"},
    NamedCode{0x3220, "under-voltage of the DC link"},
    NamedCode{0x4310, "drive over-temperature"},
    NamedCode{0x7121, "motor blocked"},
    NamedCode{0x7305, "encoder"},
    NamedCode{0x8100, "communication"},
    NamedCode{0x8110, "CAN overrun"},
    NamedCode{0x8120, "CAN error passive"},
    NamedCode{0x8130, "heartbeat lost"},
    NamedCode{0x8140, "recovered from bus-off"},
    NamedCode{0x8210, "PDO with too few bytes"},
    NamedCode{0x8250, "the drive missed its commands (RPDO deadline)"},
    NamedCode{0x8611, "following error"},
};
// By the code's first byte; CiA 301.
constexpr std::array kClasses{
    NamedCode{0x10, "generic error"},
    NamedCode{0x20, "current"},
    NamedCode{0x21, "input current"},
    NamedCode{0x22, "current inside the drive"},
    NamedCode{0x23, "output current"},
    NamedCode{0x30, "voltage"},
    NamedCode{0x31, "supply voltage"},
    NamedCode{0x32, "voltage inside the drive"},
    NamedCode{0x33, "output voltage"},
    NamedCode{0x40, "temperature"},
    NamedCode{0x41, "ambient temperature"},
    NamedCode{0x42, "temperature of the drive"},
    NamedCode{0x43, "temperature of the drive"},
    NamedCode{0x50, "drive hardware"},
    NamedCode{0x60, "drive software"},
    NamedCode{0x61, "internal software"},
    NamedCode{0x62, "user software"},
    NamedCode{0x63, "data set"},
    NamedCode{0x70, "additional modules"},
    NamedCode{0x71, "power section"},
    NamedCode{0x73, "sensor"},
    NamedCode{0x80, "monitoring"},
    NamedCode{0x81, "communication"},
    NamedCode{0x82, "CANopen protocol"},
    NamedCode{0x83, "torque control"},
    NamedCode{0x84, "velocity control"},
    NamedCode{0x86, "positioning"},
    NamedCode{0x90, "external error"},
    NamedCode{0xF0, "additional functions"},
    NamedCode{0xFF, "maker's own error"},
};

const char* words_of_state(cia402::PowerState state) {
  switch (state) {
    case cia402::PowerState::not_ready:
      return "not ready to switch on: it still starts, or waits for its supply";
    case cia402::PowerState::switch_on_disabled:
      return "switch-on disabled: is safe torque off (STO) released, and is there supply for its power stage?";
    case cia402::PowerState::ready:
      return "ready to switch on: does its power stage get its supply?";
    case cia402::PowerState::switched_on:
      return "switched on: does its brake or an enable input keep it there?";
    case cia402::PowerState::quick_stop:
      return "quick stop";
    case cia402::PowerState::operation_enabled:
    case cia402::PowerState::fault_reaction:
    case cia402::PowerState::fault:
    case cia402::PowerState::undefined:
      break;
  }
  return "no state of CiA 402";
}

std::string stays_off(std::uint16_t statusword) {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "it does not enable: statusword %04X, ", statusword);
  return text.data() + std::string(words_of_state(cia402::power_state(statusword)));
}

template <std::size_t kCount>
const char* name_in(const std::array<NamedCode, kCount>& table, std::uint32_t code) {
  const auto* found = std::ranges::find(table, code, &NamedCode::code);
  return found == table.end() ? nullptr : found->name;
}

}  // namespace

std::expected<std::unique_ptr<JointDriver>, std::string> make_cia402_driver(const config::RobotConfig& robot,
                                                                            std::size_t joint) {
  const config::Joint& wanted = robot.joints[joint];
  const config::Drive& drive = wanted.drive;
  if (const char* const wrong = wrong_with(drive)) return std::unexpected(wrong);
  const Duration period = robot.control.period;
  const auto interpolation = cia402::interpolation_period(period);
  if (!interpolation)
    return std::unexpected("control.period does not fit object 60C2 (1 to 255 times a power of ten, in whole us)");
  const auto identity = words_of("identity", drive.identity, {.style = WordStyle::hex, .least = 2, .most = 3});
  const auto revision = words_of("firmware", drive.firmware, {.style = WordStyle::hex});
  if (!identity || !revision) return std::unexpected(identity ? revision.error() : identity.error());
  Cia402DriveSettings settings;
  settings.scale = scale_of(drive);
  settings.setup = {.node = drive.id,
                    .mode = drive.mode,
                    .period = *interpolation,
                    .rated_torque_mNm = static_cast<std::uint32_t>(std::llround(drive.rated_torque * 1000)),
                    .max_torque_per_mille = max_torque_per_mille(wanted),
                    .velocity_unit = drive.velocity_unit,
                    .following_window = following_window(robot, wanted),
                    .following_timeout_ms = following_timeout_ms(robot),
                    .watchdog_waived = config::waives_watchdog(drive),
                    .identity = *identity,
                    .revision = *revision};
  settings.patience = {.answer_ticks = ticks_in(milliseconds(50), period),
                       .tries = 5,
                       .pause_ticks = ticks_in(milliseconds(500), period)};
  settings.mapping = mapping_of(drive);
  settings.velocity_bandwidth = static_cast<float>(wanted.observer_bandwidth);
  settings.max_heartbeat_ticks = ticks_in(cia402::kHeartbeatPeriod * 3, period);
  settings.our_heartbeat_ticks = ticks_in(cia402::kOurHeartbeatPeriod, period);
  settings.follow_ticks = ticks_in(milliseconds(50), period);
  settings.limit_ticks = ticks_in(seconds(1), period);
  // Before the executive's own patience ends, so that the drive's words are told.
  if (const std::int64_t patience_ns = robot.feedback.enable_timeout.ns; patience_ns > 0)
    settings.enable_ticks = ticks_in(Duration{patience_ns / 10 * 9}, period);
  settings.sends_sync = is_last_of_its_bus(robot, joint);
  return std::make_unique<Cia402Driver>(settings);
}

std::vector<FrameTraffic> cia402_traffic(const config::RobotConfig& robot, std::size_t joint) {
  const double period = robot.control.period.seconds();
  const double heartbeats =
      period / cia402::kHeartbeatPeriod.seconds() + std::min(1.0, period / cia402::kOurHeartbeatPeriod.seconds());
  std::vector<FrameTraffic> traffic{{.bytes = cia402::rpdo_bytes(robot.joints[joint].drive.mode)},
                                    {.bytes = cia402::kTpdoBytes},
                                    {.bytes = 1, .per_tick = heartbeats}};
  if (is_last_of_its_bus(robot, joint)) traffic.push_back({.bytes = 0});
  return traffic;
}

std::string cia402_error_name(const config::Drive& /*drive*/, std::uint32_t code) {
  if (const SettingDetail detail = detail_of(code); detail.setting != 0) {
    std::array<char, 32> object{};
    std::snprintf(object.data(), object.size(), "object %04X:%02X", detail.setting, detail.part);
    return object.data() + (detail.said == 0 ? std::string() : ", abort " + cia402::abort_text(detail.said));
  }
  if (code == Cia402Driver::kNotFollowing)
    return "it is enabled and does not obey its target (statusword bit 12): another mode, a halt or a limit of its own";
  if (code == Cia402Driver::kLimited)
    return "a limit inside the drive has stood in the target's way for a second (statusword bit 11)";
  if ((code & ~0xFFFFU) == Cia402Driver::kStaysOff) return stays_off(static_cast<std::uint16_t>(code & 0xFFFFU));
  if (code == 0 || code > 0xFFFF) return {};
  if (const char* const name = name_in(kCodes, code)) return name;
  if (const char* const name = name_in(kClasses, code >> 8U)) return name;
  return {};
}

}  // namespace takt::drivers
