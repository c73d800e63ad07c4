// SPDX-License-Identifier: Apache-2.0
// One moteus controller in position mode, host side: joint units in, one CAN FD frame per tick out, its reply in.
//
// Every command carries the whole impedance setpoint: position, velocity, feed-forward torque, kp and kd as scales 0..1
// of the drive's own gains, the torque limit, and how long it is valid: the remaining life of the command, within
// [silence, kMoteusLongestWatchdog]. It is never zero (the drive's default) nor NaN (for ever). When no
// policy command is in use (valid_until unset: the executive's own hold or damping) the shortest applies. Velocity and
// acceleration limits are switched off in every command: the drive follows the law and no trajectory of its own.
//
// The firmware holds the kd scale down to the kp scale, and no scale exceeds 1. What the scales cannot say, all damping
// at zero stiffness for one, comes within the setpoint's torque: DriveGains in the pipeline's tick_config.hpp.
//
// phase        sends                                    entered by
// disabling    mode 0, which also clears faults         enable false
// enabling     position mode with zero gains            enable rising, once the drive's home is known
// driving      the setpoint                             a reply since then says mode 10
// left         the query alone; mode 0 while the        a fault while enabling; while driving any other mode than
//              drive reports mode 10                    10, or no reply for `silence`: until enable false
//
// A drive whose supply blinked would obey the next position command as if nothing had been: hence silence counts too.
// Mode 10 is enabled; 1 (fault) and 11 (watchdog expired) are faults; anything else is disabled. error_code is the
// drive's fault code, or the mode's number when there is none; codes 96..103 tell limits, not faults, and are dropped.
// While disabled it is asked now and then who it is (100, 101, 120 to 122) until it tells, and again after a silence;
// what the robot file names of it (drive.identity, drive.firmware) must be so, else it is a fault and not enabled.
// While disabled the home state (00C) is asked for too: anything but 2, referenced to the output, is a fault
// (SetupFault::home_unknown): a rotor's own reference leaves a geared joint in one of several places.
//
// Expected in the drive: id.id, servo.pid_position kp and kd as servo_kp and servo_kd say (per radian, times 2 pi per
// turn), ki 0, 1/5 Mbit/s. Thread rule: as JointDriver.
#pragma once

#include "drivers/protocol/assumed_home.hpp"
#include "drivers/protocol/moteus/moteus_codec.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::drivers {

inline constexpr Duration kMoteusLongestWatchdog = seconds(1);
// A drive that restarts within the silence is obeyed as if nothing had been: hence the upper bound.
inline constexpr Duration kMoteusShortestSilence = milliseconds(20), kMoteusLongestSilence = milliseconds(100);
inline constexpr std::size_t kMoteusCommandBytes = 48, kMoteusReplyBytes = 24;

struct MoteusDriveSettings {
  std::uint32_t id = 1;              // 1..127
  float torque_range = 0;            // Nm; finite, > 0
  float servo_kp = 0, servo_kd = 0;  // Nm/rad, Nm s/rad, motor side; finite, > 0
  JointMapping mapping;
  // How long either side may be silent before the other gives it up: feedback.timeout, within the bounds above.
  Duration silence = kMoteusShortestSilence;
  DriveWords identity{}, firmware{};  // that it must tell; nothing: any
  Duration period = milliseconds(1);  // of encode()
};

// What a reply tells of the drive beside its state.
struct MoteusFacts {
  std::optional<DriveWords> serial_number, firmware;  // serial number: most significant word first
  std::optional<std::uint32_t> model, home;
};
MoteusFacts decode_moteus_facts(const CanFrame& frame) noexcept;

class MoteusDriver final : public JointDriver {
 public:
  static constexpr std::uint32_t kAsksForIdentity = 10, kTicksPerAsk = 20;

  explicit MoteusDriver(const MoteusDriveSettings& settings) noexcept : settings_(settings) {}

  std::size_t encode(bool enable, const DriveSetpoint& setpoint, MonoTime now, MonoTime valid_until,
                     std::span<CanFrame> out) noexcept override;
  [[nodiscard]] bool is_set_up() const noexcept override;
  void assume_home(float q, float tolerance) noexcept override { assumed_home_.assume(q, tolerance); }
  bool decode(const ReceivedFrame& received) noexcept override;
  [[nodiscard]] const JointFeedback& feedback() const noexcept override { return feedback_; }
  // Frames on the reply id that are no reply to our query, or hold no numbers.
  [[nodiscard]] std::uint64_t malformed_frames() const { return malformed_frames_; }

 private:
  enum class Phase : std::uint8_t { disabling, enabling, driving, left };
  // Motor side, as the drive wants it: rev, rev/s, Nm, 0..1.
  struct Command {
    float position = 0, velocity = 0, torque = 0, kp_scale = 0, kd_scale = 0;
  };
  void advance(bool enable) noexcept;
  [[nodiscard]] Command limp() const noexcept;
  [[nodiscard]] Command command_for(const DriveSetpoint& setpoint) const noexcept;
  bool is_time_to_ask() noexcept;
  [[nodiscard]] bool may_enable() const noexcept;
  [[nodiscard]] std::uint32_t setup_error() const noexcept;
  void write_command(const Command& command, Duration budget, MoteusWriter& writer) const noexcept;

  MoteusDriveSettings settings_;
  JointFeedback feedback_;
  std::uint64_t malformed_frames_ = 0;
  Phase phase_ = Phase::disabling;
  bool heard_since_request_ = false;
  Duration silent_for_{};    // commands since the newest reply, times their period
  float q_ = 0;              // newest, motor side: rad
  bool knows_home_ = false;  // as told last, while disabled
  AssumedHome assumed_home_;
  std::optional<DriveWords> identity_, firmware_;
  std::uint32_t asks_ = 0, ticks_to_ask_ = kTicksPerAsk;  // since the drive was heard first, or again
  std::uint32_t silent_ticks_ = 0;                        // in a row, while disabled
};

// The protocol's row in the table.
std::expected<std::unique_ptr<JointDriver>, std::string> make_moteus_driver(const config::RobotConfig& robot,
                                                                            std::size_t joint);
std::vector<FrameTraffic> moteus_traffic(const config::RobotConfig& robot, std::size_t joint);
std::string moteus_error_name(const config::Drive& drive, std::uint32_t code);
std::vector<CardRow> moteus_card_rows(const config::RobotConfig& robot, std::size_t joint);
void moteus_settings_told(const config::Drive& drive, const CanFrame& frame, ToldSettings& told);

}  // namespace takt::drivers
