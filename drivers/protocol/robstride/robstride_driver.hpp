// SPDX-License-Identifier: Apache-2.0
// One RobStride or CyberGear drive, host side: joint units in, frames out, feedback in.
//
// enable false: stop every tick, which the drive answers with its position; while it shows a fault every other stop
//   clears it. Meanwhile, in every fourth tick, the set-up: run mode 0 (obey motion commands) is written in the place
//   of one stop and read back, then the CAN time-out likewise (7028). A drive without that parameter (CyberGear) is
//   asked for its stored one (200C), which counts when it is set, to at most a second. Then in which turn it begins to
//   count after power-on (7029), which may stay untold, and last for its unique id, which it must tell if the robot
//   file names one (drive.identity). Another id, a run mode that does not stay, no answer, a time-out that is off or
//   unknown, or a turn that does not hold an absolute joint's places becomes a fault of the drive (SetupFault with the
//   parameter's number) and is tried again twice a second at 1 kHz; a waiver in the robot file lets the time-out pass.
//   All of it again after the drive was enabled and after kTicksToDoubt without a word: what was written is lost with
//   its supply.
// enable rising: enable every tick until the drive reports that it runs; before its run mode is known, as above.
// enabled once: motion commands only. A drive that stops by itself is not brought back before `enable` was false in
//   between: that is the operator's decision.
//
// Before the first feedback feedback().received_at is unset and drive_state unknown. Thread rule: as JointDriver.
#pragma once

#include "drivers/protocol/drive_timeout.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "drivers/protocol/robstride/robstride_codec.hpp"

namespace takt::drivers {

// What must be true of the drive's own time-out before it may be enabled.
struct RobstrideTimeoutWish {
  std::uint32_t units = 0;   // written into 7028, then read back
  bool has_volatile = true;  // false: known to have 200C only, and no 7029
  bool waived = false;       // the robot file allows it to be off or unknown
};

// SettingDetail::setting of the unique id, which has no parameter's number.
inline constexpr std::uint32_t kRobstrideIdentity = 1;

struct RobstrideDriveSettings {
  RobstrideRange range;
  RobstrideAddress address;
  JointMapping mapping;
  RobstrideTimeoutWish timeout;
  DriveWords identity{};           // that it must tell; nothing: any drive may be there
  bool begins_below_zero = false;  // 7029 must be 1: its joint may stand there, and is taken to be where it reads
};
// By the robot file.
bool begins_below_zero(const config::Joint& joint);

// What the drive must be asked and told before it may be enabled, one step at a time.
class RobstrideSetup {
 public:
  RobstrideSetup(const RobstrideTimeoutWish& timeout, const DriveWords& identity, bool begins_below_zero) noexcept
      : wish_(timeout), identity_(identity), begins_below_zero_(begins_below_zero) {}
  // The next frame, if it is time for one: `instead_of_stop` tells whether it takes the stop's place (it is answered by
  // feedback) or goes beside it. Call once per tick in which the drive is heard and not running.
  struct Step {
    CanFrame frame;
    bool instead_of_stop = false;
  };
  std::optional<Step> next(RobstrideAddress address) noexcept;
  void take(const RobstrideAnswer& answer) noexcept;
  void take(const RobstrideIdentity& told) noexcept;
  // The drive may have forgotten: from the beginning. Keeps error_code() until it ends well.
  void restart() noexcept;
  // Run mode 0 was read back, and a time-out or a waiver stands behind it.
  [[nodiscard]] bool may_enable() const { return stage_ == Stage::done; }
  // JointFeedback::error_code of what went wrong; 0: nothing so far.
  [[nodiscard]] std::uint32_t error_code() const { return error_code_; }
  // As read last, in units of 50 us; nothing: it was not told.
  [[nodiscard]] std::optional<std::uint32_t> timeout() const { return timeout_; }

 private:
  enum class Stage : std::uint8_t {
    set_mode,
    ask_mode,
    set_timeout,
    ask_timeout,
    ask_stored,
    ask_zero,
    ask_identity,
    done,
    failed
  };
  void enter(Stage stage) noexcept;
  void fail(SetupFault fault, std::uint32_t setting) noexcept;
  void fail(SetupFault fault, RobstrideParameter which) noexcept { fail(fault, static_cast<std::uint32_t>(which)); }
  void give_up() noexcept;
  void judge_timeout(RobstrideParameter which) noexcept;
  void take_mode(const RobstrideAnswer& answer) noexcept;
  void take_timeout(const RobstrideAnswer& answer) noexcept;
  void take_zero(const RobstrideAnswer& answer) noexcept;
  void go_on_from_timeout() noexcept { enter(wish_.has_volatile ? Stage::ask_zero : Stage::ask_identity); }

  RobstrideTimeoutWish wish_;
  DriveWords identity_;
  bool begins_below_zero_;
  Stage stage_ = Stage::set_mode;
  std::uint32_t tick_ = 0;
  int tries_ = 0;
  bool mode_was_read_ = false;
  std::uint32_t error_code_ = 0;
  std::optional<std::uint32_t> timeout_;
};

class RobstrideDriver final : public JointDriver {
 public:
  explicit RobstrideDriver(const RobstrideDriveSettings& settings) noexcept
      : settings_(settings), setup_(settings.timeout, settings.identity, settings.begins_below_zero) {}

  std::size_t encode(bool enable, const DriveSetpoint& setpoint, MonoTime now, MonoTime valid_until,
                     std::span<CanFrame> out) noexcept override;
  [[nodiscard]] bool is_set_up() const noexcept override { return setup_.may_enable(); }
  bool decode(const ReceivedFrame& received) noexcept override;
  [[nodiscard]] const JointFeedback& feedback() const noexcept override { return feedback_; }
  // Frames of a known kind from this drive that have not 8 bytes of classic data.
  [[nodiscard]] std::uint64_t malformed_frames() const { return malformed_frames_; }
  // After how long without a command the drive stops by itself, as read last. Zero: never. Nothing: not told (yet).
  [[nodiscard]] std::optional<Duration> stored_timeout() const;

 private:
  std::size_t encode_standby(std::span<CanFrame> out) noexcept;
  void take(const RobstrideFeedback& feedback, MonoTime received_at) noexcept;
  void take(const RobstrideFaultReport& report) noexcept;
  void take(const RobstrideAnswer& answer) noexcept;
  void take(const RobstrideIdentity& told) noexcept;
  void judge() noexcept;

  RobstrideDriveSettings settings_;
  RobstrideSetup setup_;
  JointFeedback feedback_;
  std::uint64_t malformed_frames_ = 0;
  enum class Wish : std::uint8_t { disable, enter, drive };
  Wish wish_ = Wish::disable;
  RobstrideMode mode_ = RobstrideMode::reserved;  // as last reported
  std::uint32_t faults_ = 0;                      // of the newest feedback
  std::uint32_t reported_faults_ = 0;             // of the newest fault report that was not cleared since
  bool heard_ = false;                            // feedback came since the last standby tick
  std::uint32_t silent_ticks_ = 0;
  bool clear_next_ = false;
  bool clear_sent_ = false;  // since the newest fault report
};

// The protocol's row in the table.
std::expected<std::unique_ptr<JointDriver>, std::string> make_robstride_driver(const config::RobotConfig& robot,
                                                                               std::size_t joint);
std::vector<FrameTraffic> robstride_traffic(const config::RobotConfig& robot, std::size_t joint);
// Codes: bits 0..5 as in feedback, bits 8..30 as in fault reports from their bit 0.
std::string robstride_error_name(const config::Drive& drive, std::uint32_t code);
std::vector<CardRow> robstride_card_rows(const config::RobotConfig& robot, std::size_t joint);
void robstride_settings_told(const config::Drive& drive, const CanFrame& frame, ToldSettings& told);

}  // namespace takt::drivers
