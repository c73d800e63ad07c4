// SPDX-License-Identifier: Apache-2.0
// One MIT drive, host side: joint units in, frames out, replies in.
//
// enable false: exit motor mode every tick, which also makes the drive report; a Damiao drive that reports an error is
//   told to clear it every other tick. Beside it a Damiao drive's time-out is written and its settings are read back
//   (damiao_registers.hpp), one frame every fourth tick; again after it was enabled, and after kTicksToDoubt without a
//   reply, for what was written is lost with its supply. What differs from the robot file, is not told, or would not
//   stop it, shows as a fault of the drive until a later attempt agrees; clearing errors does not touch it.
// enable rising: enter motor mode every tick until the drive reports that it is enabled; as above before its settings
//   are known to agree. A T-Motor drive has no state in its reply and counts as enabled, or disabled, by the first
//   reply after the frame that asks for it; its settings cannot be read, its time-out neither: without a waiver in the
//   robot file it has a fault that says so, and is not enabled. One that is heard to speak the protocol of AK V3
//   firmware, or to be a RobStride, has a fault that names it, for kTicksToForget after its last such word.
// enabled once: motion commands only. A drive that leaves motor mode by itself is not brought back before `enable` was
//   false in between: that is the operator's decision.
//
// Before the first reply feedback().received_at is unset and drive_state unknown.
// Values are clamped to the packed ranges; the joint's own limits are not this class's business. Thread rule: as
// JointDriver.
#pragma once

#include "drivers/protocol/mit/damiao_registers.hpp"
#include "drivers/protocol/mit/mit_codec.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::drivers {

struct MitDriveSettings {
  MitRange range;
  MitVariant variant = MitVariant::damiao;
  std::uint32_t id = 0, reply_id = 0;
  JointMapping mapping;
  DriveTimeoutWish timeout;
  DamiaoIdentity identity{};
  // Damiao: it speaks CAN FD with bit rate switch, and register 35 must say so; 0: classic frames.
  std::uint32_t fd_bit_rate_code = 0;
  [[nodiscard]] bool fd() const { return fd_bit_rate_code != 0; }
};

class MitDriver final : public JointDriver {
 public:
  static constexpr std::uint32_t kTicksToForget = 2000;
  // Beside kAkV3Feedback and kRobstrideInMit: a Damiao that answers in classic frames where the file says CAN FD, or
  // the other way round.
  static constexpr std::uint32_t kOtherFrames = 0x2902;

  explicit MitDriver(const MitDriveSettings& settings) noexcept
      : settings_(settings),
        readback_(settings.id, settings.range, settings.timeout, settings.identity, settings.fd_bit_rate_code) {}

  std::size_t encode(bool enable, const DriveSetpoint& setpoint, MonoTime now, MonoTime valid_until,
                     std::span<CanFrame> out) noexcept override;
  [[nodiscard]] bool is_set_up() const noexcept override;
  bool decode(const ReceivedFrame& received) noexcept override;
  [[nodiscard]] const JointFeedback& feedback() const noexcept override { return feedback_; }
  // Frames on the reply id that are no reply of this protocol.
  [[nodiscard]] std::uint64_t malformed_frames() const { return malformed_frames_; }
  // After how long without a command the drive gives up by itself, as read last. Zero: never. Nothing: not told (yet).
  [[nodiscard]] std::optional<Duration> stored_timeout() const;

 private:
  MitPayload payload_for(bool enable, const DriveSetpoint& setpoint) noexcept;
  void note_silence() noexcept;
  [[nodiscard]] std::uint32_t setup_error() const noexcept;
  void take(const MitReply& reply, MonoTime received_at) noexcept;
  bool take_other_protocol(const CanFrame& frame) noexcept;
  [[nodiscard]] std::uint32_t other_protocol_of(const CanFrame& frame) const noexcept;
  void judge() noexcept;
  [[nodiscard]] DriveState reported_state() const noexcept;

  MitDriveSettings settings_;
  DamiaoReadback readback_;  // Damiao only
  JointFeedback feedback_;
  std::uint64_t malformed_frames_ = 0;
  std::uint8_t status_ = 0;  // of the newest reply
  bool heard_ = false;       // a reply came since the last tick that was spent disabled
  std::uint32_t silent_ticks_ = 0;
  std::uint32_t other_protocol_ticks_ = 0;  // left before a word of another protocol is forgotten
  std::uint32_t other_protocol_ = 0;        // kAkV3Feedback, kRobstrideInMit, or kOtherFrames
  enum class Wish : std::uint8_t { disable, enter, drive };
  Wish wish_ = Wish::disable;
  bool anything_sent_ = false;
  bool clear_next_ = false;
};

// The protocol's row in the table.
std::expected<std::unique_ptr<JointDriver>, std::string> make_mit_driver(const config::RobotConfig& robot,
                                                                         std::size_t joint);
std::vector<FrameTraffic> mit_traffic(const config::RobotConfig& robot, std::size_t joint);
std::string mit_error_name(const config::Drive& drive, std::uint32_t code);
std::vector<CardRow> mit_card_rows(const config::RobotConfig& robot, std::size_t joint);
void mit_settings_told(const config::Drive& drive, const CanFrame& frame, ToldSettings& told);

}  // namespace takt::drivers
