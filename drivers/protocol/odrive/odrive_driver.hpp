// SPDX-License-Identifier: Apache-2.0
// One ODrive (firmware 0.6, CANSimple), host side: joint units in, torques out, broadcasts in.
//
// The drive takes finished torques: a setpoint's tau, and nothing else of it. One frame leaves per tick (two in the
// tick that disables, and where one asks). A drive that is driven is asked for nothing: on some firmware any frame, a
// question too, feeds the drive's watchdog, and a live bus is not a live command. Before, while it is disabled, it is
// asked for its version, kAsksForVersion times at most; one that the robot file names (drive.firmware) it must tell.
// All else it must be set up to tell by itself:
//   axis.config.can: encoder_msg_rate_ms = control.period (1), heartbeat_msg_rate_ms 10, torques_msg_rate_ms 10,
//   temperature_msg_rate_ms 100, error_msg_rate_ms 100, bus_voltage_msg_rate_ms 100 or 0, iq_msg_rate_ms 0;
//   axis.config: enable_watchdog true, watchdog_timeout as long as a command may live: the protocol has no field for
//   it, and the numbers by which parameters are read over CAN change with every firmware. So it stays unknown: without
//   a waiver in the robot file the drive has a fault that says so, and is not enabled.
// Slower reports work too; the bus load is computed from these. Encoder estimates are the replies that are counted.
//
// state        says                                        entered by
// disabling    idle, torque control, zero torque in turn   enable false (first tick: idle and zero torque at once)
//              (a faulty drive: clear errors instead)
// enabling     torque control, zero torque, closed loop,   enable rising; repeated every kAskAgainTicks
//              then zero torques
// driving      the setpoint's torque                       a heartbeat since the request says closed loop
// left         zero torque; idle, should the drive report  the drive left closed loop or reported an error by itself:
//              closed loop again                           until enable false
// A drive with firmware before 0.6 has a fault that names it, and is not enabled: 0.5 numbers errors and messages
// otherwise. A drive that counts from wherever it was switched on is not enabled before it was told where it is
// (OdriveHomeMark). The drive's state is its newest heartbeat's: closed loop is enabled, an error is a fault, anything
// else is disabled. A heartbeat that is older than kOdriveHeartbeatTimeout when an estimate arrives counts as a fault
// of its own, kOdriveNoHeartbeat, so that a half-dead drive is not taken for enabled; when estimates stop too, the
// tick's feedback timeout acts. Before the first heartbeat the state is unknown, before the first estimate received_at
// is unset. Thread rule: as JointDriver.
#pragma once

#include "drivers/protocol/assumed_home.hpp"
#include "drivers/protocol/odrive/odrive_codec.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::drivers {

inline constexpr Duration kOdriveHeartbeatTimeout = milliseconds(500);
// JointFeedback::error_code; no drive sets every bit at once.
inline constexpr std::uint32_t kOdriveNoHeartbeat = 0x7FFF'FFFF;

// SettingDetail::setting of the firmware: message 00 has a value that is invalid for it.
inline constexpr std::uint32_t kOdriveFirmware = 1;
// Of a drive whose firmware is before 0.6: its heartbeat or its version says so. What it says else is read as nothing.
inline constexpr std::uint32_t kOdriveOldFirmware = 2;

// Of a drive that counts from wherever it was switched on (position_after_power_up: unknown). One that was told where
// it is (Set_Absolute_Position) was told `turns` more than its place, so that its own reading says whether it was, and
// says so no longer once it lost its supply: what the joint can move since power-on ends far below `least`.
struct OdriveHomeMark {
  float turns = 0, least = 0;  // motor turns
};
// Nothing: the drive knows its place.
std::optional<OdriveHomeMark> odrive_home_mark(const config::Joint& joint);

struct OdriveDriveSettings {
  std::uint32_t node = 0;
  JointMapping mapping;
  bool watchdog_waived = false;
  DriveWords firmware{};  // that it must tell; nothing: any
  std::optional<OdriveHomeMark> home_mark{};
};

class OdriveDriver final : public JointDriver {
 public:
  // Asking an enabled axis again may make it stumble: seldom.
  static constexpr std::uint32_t kAskAgainTicks = 250;
  static constexpr std::uint32_t kAsksForVersion = 10, kTicksPerAsk = 20;

  explicit OdriveDriver(const OdriveDriveSettings& settings) noexcept : settings_(settings) {}

  std::size_t encode(bool enable, const DriveSetpoint& setpoint, MonoTime now, MonoTime valid_until,
                     std::span<CanFrame> out) noexcept override;
  [[nodiscard]] bool is_set_up() const noexcept override;
  void assume_home(float q, float tolerance) noexcept override { assumed_home_.assume(q, tolerance); }
  bool decode(const ReceivedFrame& received) noexcept override;
  [[nodiscard]] const JointFeedback& feedback() const noexcept override { return feedback_; }
  // Frames with one of the reports' ids that are no such report, and estimates that are no numbers.
  [[nodiscard]] std::uint64_t malformed_frames() const { return malformed_frames_; }

 private:
  enum class Phase : std::uint8_t { disabling, set_mode, zero_torque, request, wait, driving, left };
  std::size_t encode_disabled(std::span<CanFrame> out) noexcept;
  CanFrame enabled_frame(const DriveSetpoint& setpoint) noexcept;
  CanFrame waiting_frame(const DriveSetpoint& setpoint) noexcept;
  bool is_time_to_ask() noexcept;
  [[nodiscard]] std::uint32_t setup_error() const noexcept;
  [[nodiscard]] CanFrame torque_frame(const DriveSetpoint& setpoint) const noexcept;
  bool take(OdriveMessage message, const ReceivedFrame& received) noexcept;
  bool take_version(const CanFrame& frame) noexcept;
  bool take_heartbeat(const ReceivedFrame& received) noexcept;
  bool take_errors(const CanFrame& frame) noexcept;
  bool take_estimates(const ReceivedFrame& received) noexcept;
  bool take_temperatures(const CanFrame& frame) noexcept;
  bool take_torques(const CanFrame& frame) noexcept;
  bool without_a_number() noexcept;
  void judge_state() noexcept;
  [[nodiscard]] bool reports_errors() const noexcept { return heartbeat_missing_ || active_errors_ != 0; }

  OdriveDriveSettings settings_;
  JointFeedback feedback_;
  std::uint64_t malformed_frames_ = 0;
  Phase phase_ = Phase::disabling;
  std::uint32_t turn_ = 0;  // disabling: whose turn it is
  std::uint32_t waited_ticks_ = 0;
  bool heard_since_request_ = false;
  // As the drive reported last, motor side.
  MonoTime heartbeat_at_;
  std::uint8_t axis_state_ = 0;
  std::uint32_t active_errors_ = 0, disarm_reason_ = 0;
  bool heartbeat_missing_ = false;
  float tau_ = 0;  // Nm
  bool was_told_home_ = false;
  bool old_firmware_ = false;  // since it was heard first, or again
  AssumedHome assumed_home_;
  std::optional<DriveWords> firmware_;
  std::uint32_t asks_ = 0, ticks_to_ask_ = kTicksPerAsk;  // since the drive was heard first, or again
};

// The protocol's row in the table.
std::expected<std::unique_ptr<JointDriver>, std::string> make_odrive_driver(const config::RobotConfig& robot,
                                                                            std::size_t joint);
std::vector<FrameTraffic> odrive_traffic(const config::RobotConfig& robot, std::size_t joint);
std::string odrive_error_name(const config::Drive& drive, std::uint32_t code);
std::vector<CardRow> odrive_card_rows(const config::RobotConfig& robot, std::size_t joint);
void odrive_settings_told(const config::Drive& drive, const CanFrame& frame, ToldSettings& told);

}  // namespace takt::drivers
