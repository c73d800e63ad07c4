// SPDX-License-Identifier: Apache-2.0
// One CANopen CiA 402 drive, host side: set-up, cyclic process data, joint units in and out.
//
// phase      while                         frames per tick (SYNC besides, see below)        drive_state
// set-up     until the drive is            NMT or one SDO question, at most, and only       unknown; disabled after a
//            operational as we want it     while `enable` is false                          reboot; fault when it
//            failed
// cyclic     its heartbeat says so         one RPDO                                         as the statusword says
// Back to set-up: the drive boots, or reports another NMT state, or a lost heartbeat is to be cleared.
//
// enable false: controlword 00 (disable voltage), with a rising edge of 80 now and then while the drive reports a
//   fault. RPDO and SYNC go on, so position is reported every tick.
// enable rising: 06, 07, 0F, each when the statusword asks for it. Until then, and in every frame before operation is
//   enabled, the target is one that pushes nowhere. Enabled is what the drive calls "operation enabled", nothing less.
// enabled once: a drive that leaves operation by itself, whatever for, gets 00 until `enable` was false in between. So
//   does one that says it is enabled and ignores its target (statusword bit 12 clear for follow_ticks: kNotFollowing),
//   or that a limit inside it stands in the target's way (bit 11 set for limit_ticks: kLimited), or that does not get
//   there within enable_ticks (kStaysOff and its statusword).
// Faults: error_code is the newest EMCY code (kGenericError if none was heard); no heartbeat for three of its periods
//   is kHeartbeatLost, until set-up went through again; SetupFault as in cia402_setup.hpp.
// A drive that watches our heartbeat hears it every our_heartbeat_ticks, from the set-up on.
//
// SYNC is the bus's: exactly one driver sends it, after its own frames, in every tick: that of the last cia402 joint on
// the bus, so that every RPDO of the tick is out before. At most 4 frames per tick.
// Velocity comes from position: differences between receive stamps, low-passed at velocity_bandwidth. What targets
// mean: cia402_target.hpp. A command's remaining life has no field here; see cia402_setup.hpp for the drive's own
// watchdog. Thread rule: as JointDriver.
#pragma once

#include "drivers/protocol/cia402/cia402_codec.hpp"
#include "drivers/protocol/cia402/cia402_setup.hpp"
#include "drivers/protocol/cia402/cia402_target.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::drivers {

struct Cia402DriveSettings {
  cia402::Scale scale;
  cia402::SetupValues setup;
  cia402::SetupPatience patience;
  JointMapping mapping;
  float velocity_bandwidth = 200;  // rad/s
  std::uint32_t max_heartbeat_ticks = 300;
  std::uint32_t our_heartbeat_ticks = 10, follow_ticks = 50, limit_ticks = 1000, enable_ticks = 450;  // each >= 1
  bool sends_sync = true;
};

class Cia402Driver final : public JointDriver {
 public:
  static constexpr std::uint32_t kGenericError = 0x1000, kHeartbeatLost = 0x8130;  // CiA 301 error codes
  static constexpr std::uint32_t kNotFollowing = 0x1'0001, kLimited = 0x1'0002;    // beyond them
  static constexpr std::uint32_t kStaysOff = 0x2'0000;                             // its lower half: the statusword

  explicit Cia402Driver(const Cia402DriveSettings& settings) noexcept;

  std::size_t encode(bool enable, const DriveSetpoint& setpoint, MonoTime now, MonoTime valid_until,
                     std::span<CanFrame> out) noexcept override;
  [[nodiscard]] bool is_set_up() const noexcept override { return setup_.done(); }
  void assume_set_up() noexcept override { setup_.assume_done(); }
  bool decode(const ReceivedFrame& received) noexcept override;
  [[nodiscard]] const JointFeedback& feedback() const noexcept override { return feedback_; }
  // The newest EMCY code.
  [[nodiscard]] std::uint32_t remark() const noexcept override { return emergency_; }
  // Frames on the drive's ids that this protocol does not know.
  [[nodiscard]] std::uint64_t malformed_frames() const noexcept { return malformed_frames_; }
  // What the drive said to SetupFault::setup_refused; 0: nothing yet.
  [[nodiscard]] std::uint32_t abort_code() const noexcept { return setup_.abort_code(); }
  [[nodiscard]] const cia402::Setup& setup() const noexcept { return setup_; }

 private:
  enum class Wish : std::uint8_t { disable, enter, drive, left };
  void note_wish(bool enable) noexcept;
  void note_silence(bool enable) noexcept;
  void note_obedience(std::uint16_t statusword) noexcept;
  bool is_time_for_our_heartbeat() noexcept;
  [[nodiscard]] CanFrame command(const DriveSetpoint& setpoint) noexcept;
  std::uint16_t way_down() noexcept;
  bool obey(const ReceivedFrame& received) noexcept;
  bool take_report(const ReceivedFrame& received) noexcept;
  bool take_heartbeat(const CanFrame& frame) noexcept;
  bool take_emergency(const CanFrame& frame) noexcept;
  bool take_sdo(const CanFrame& frame) noexcept;
  void estimate_velocity(std::int32_t position, MonoTime received_at) noexcept;
  void start_over() noexcept;
  void refresh_state() noexcept;

  Cia402DriveSettings settings_;
  cia402::Setup setup_;
  JointFeedback feedback_;
  std::uint64_t malformed_frames_ = 0;
  Wish wish_ = Wish::disable;
  cia402::PowerState power_ = cia402::PowerState::undefined;  // of the newest TPDO since set-up
  struct Slope {
    std::int32_t counts = 0;
    MonoTime at;
  };
  Slope slope_from_;         // where the next velocity is measured from
  std::int32_t counts_ = 0;  // newest position
  float dq_ = 0;             // rad/s, motor side
  std::uint16_t emergency_ = 0;
  bool seen_ = false;                // the drive was operational once
  bool heartbeat_lost_ = false;      // latched until set-up went through again
  std::uint32_t heartbeat_age_ = 0;  // ticks
  bool has_reading_ = false;         // since set-up
  std::uint32_t reset_ticks_ = 0;
  std::uint32_t our_heartbeat_age_ = 0;                      // ticks
  std::uint32_t ignored_reports_ = 0, limited_reports_ = 0;  // in a row, while it drives
  std::uint32_t disobedience_ = 0;    // kNotFollowing, kLimited or kStaysOff, until `enable` was false
  std::uint32_t entering_ticks_ = 0;  // since it was asked to enable operation
  std::uint16_t statusword_ = 0;      // of the newest TPDO
};

// The protocol's row in the table.
std::expected<std::unique_ptr<JointDriver>, std::string> make_cia402_driver(const config::RobotConfig& robot,
                                                                            std::size_t joint);
std::vector<FrameTraffic> cia402_traffic(const config::RobotConfig& robot, std::size_t joint);
std::string cia402_error_name(const config::Drive& drive, std::uint32_t code);
std::vector<CardRow> cia402_card_rows(const config::RobotConfig& robot, std::size_t joint);
void cia402_settings_told(const config::Drive& drive, const CanFrame& frame, ToldSettings& told);

}  // namespace takt::drivers
