// SPDX-License-Identifier: Apache-2.0
// What a drive is told over SDO before it may move, and the stepper that tells it: one object per tick, one question in
// flight. Everything is written again after each boot of the drive; nothing is stored in it.
//
// The watchdog against a silent host is the RPDO's event timer (1400:05, CiA 301: deadline monitoring): no RPDO for
// kCommandDeadline and the drive itself reports EMCY 8250 and stops as its own settings say. It watches the command
// stream, which a heartbeat of ours does not; and it is a fixed time, since SDO is too slow to carry a budget per
// command. Sub-index 5 is optional, though: a drive without it watches our heartbeat instead (1016:01), sent by the
// thread that commands, and takes its loss for a fault (abort connection option code 6007). Either is read back. A
// drive with neither is refused unless the robot file waives its watchdog.
//
// What a drive does not let be written (its mapping is fixed, say) is read, and must already be so.
// Modes: 6502 must have the mode where the drive has 6502; 6061 must show it, within `tries`. The unit of target
// velocity is compared with 60A9 where the drive has it. Torque: 6072 is written and read back; without it a drive that
// closes its own loop (CSP, CSV) is refused, since nothing that we send limits its torque.
//
// Its own watch on the position error (6065, 6066): of a CSP drive it is read, for the card. Where the robot file stops
// the robot for that (feedback.following), a drive that has these objects gets them, and is read back: the window of
// the joint, and a time-out that leaves the executive's stop the first word.
//
// Who it is (1018: vendor, product, revision, serial number) is read, and may stay unread where the robot file names
// nothing of it (drive.identity, drive.firmware). So is the version of its software, a text (100A), for the drive card:
// segment by segment where it is longer than four letters, kTextSegments at most.
//
// Answers that do not come within `answer_ticks` are asked for again, `tries` times in all. Then, or when the drive
// refuses or differs, fault() says which; the script is run again after `pause_ticks`, and the fault stays until it
// ends well. Thread rule: control thread only; no allocation.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "drivers/protocol/cia402/cia402_codec.hpp"
#include "drivers/protocol/drive_words.hpp"
#include "drivers/protocol/joint_driver.hpp"

namespace takt::drivers::cia402 {

inline constexpr Duration kCommandDeadline = milliseconds(50);
inline constexpr Duration kHeartbeatPeriod = milliseconds(100);  // of the drive, object 1017
inline constexpr Duration kOurHeartbeatPeriod = milliseconds(10);

// Object 60C2: value * 10^exponent seconds.
struct InterpolationPeriod {
  std::uint8_t value = 1;
  std::int8_t exponent = -3;
};
// Nothing: the period has no such form, with 1..255 and whole microseconds.
std::optional<InterpolationPeriod> interpolation_period(Duration period) noexcept;

struct SetupValues {
  std::uint32_t node = 0;
  config::Cia402Mode mode = config::Cia402Mode::cst;
  InterpolationPeriod period;
  std::uint32_t rated_torque_mNm = 0;         // compared with object 6076, to half a percent
  std::uint32_t max_torque_per_mille = 1000;  // object 6072
  config::Cia402VelocityUnit velocity_unit = config::Cia402VelocityUnit::counts_per_s;  // csv
  std::uint32_t following_window = 0;      // counts, object 6065; 0: left as it is
  std::uint16_t following_timeout_ms = 0;  // object 6066
  bool watchdog_waived = false;
  DriveWords identity{};  // vendor, product and, where there is a third, serial number; nothing: any
  DriveWords revision{};  // nothing: any
};

struct SetupPatience {
  std::uint32_t answer_ticks = 50, tries = 5, pause_ticks = 500;  // each >= 1
};

inline constexpr std::uint32_t kTextSegments = 8;

// The abort codes of CiA 301 numbered from 1, to fit an error_code: any other is the last, kOtherAbort. 0: none.
inline constexpr std::uint32_t kOtherAbort = 127;
std::uint32_t abort_number(std::uint32_t abort_code) noexcept;
// "06090030, value out of range"; of kOtherAbort: that it is the maker's own.
std::string abort_text(std::uint32_t number);

class Setup {
 public:
  Setup(const SetupValues& values, const SetupPatience& patience) noexcept : values_(values), patience_(patience) {}

  // Another host went through the script.
  void assume_done() noexcept { phase_ = Phase::done; }
  // From the beginning, such as after a boot message. Keeps fault().
  void restart() noexcept;
  // Time passes by one tick; the frame to send in it, if any.
  std::optional<CanFrame> tick() noexcept;
  void take(const SdoAnswer& answer) noexcept;
  void take(const SdoSegment& segment) noexcept;
  // The drive's heartbeat says operational.
  void take_operational() noexcept;

  // Every object is written, the drive is being started: its TPDO means what the script says, RPDOs may go.
  [[nodiscard]] bool configured() const noexcept { return phase_ == Phase::starting || phase_ == Phase::done; }
  [[nodiscard]] bool done() const noexcept { return phase_ == Phase::done; }
  // The drive has no deadline of its own for RPDOs: it is to hear our heartbeat every kOurHeartbeatPeriod.
  [[nodiscard]] bool needs_our_heartbeat() const noexcept { return watchdog_ == Watchdog::heartbeat; }
  [[nodiscard]] std::optional<SetupFault> fault() const noexcept { return fault_; }
  // What fault() was about, and what the drive said to it: CiA 301 abort code, 0: nothing.
  [[nodiscard]] std::uint32_t abort_code() const noexcept { return abort_code_; }
  [[nodiscard]] ObjectId fault_object() const noexcept { return fault_object_; }
  // JointFeedback::error_code of all that, 0: no fault. `said` is abort_number() of the abort code.
  [[nodiscard]] std::uint32_t error_code() const noexcept;

 private:
  enum class Phase : std::uint8_t { stopping, asking, starting, done, pausing };
  enum class Watchdog : std::uint8_t { unknown, deadline, heartbeat };
  [[nodiscard]] CanFrame question() const noexcept;
  [[nodiscard]] bool reads() const noexcept;
  [[nodiscard]] std::optional<std::uint32_t> named() const noexcept;
  [[nodiscard]] bool row_applies() const noexcept;
  std::optional<CanFrame> ask() noexcept;
  void next() noexcept;
  void give_up(SetupFault fault, std::uint32_t abort_code = 0) noexcept;
  void take_value(std::uint32_t found) noexcept;
  void take_abort(std::uint32_t code) noexcept;

  SetupValues values_;
  SetupPatience patience_;
  Phase phase_ = Phase::stopping;
  std::size_t row_ = 0;
  std::uint32_t asked_ = 0;     // how often this row was asked
  std::uint32_t waiting_ = 0;   // ticks to wait before asking again
  std::uint32_t refusal_ = 0;   // abort code of the write whose object is read instead; 0: none
  std::uint32_t segments_ = 0;  // of this row's text, so far
  enum class Text : std::uint8_t { none, coming, too_long };
  Text text_ = Text::none;
  bool differed_ = false;  // this row's object was read, and was not as it should be (yet)
  Watchdog watchdog_ = Watchdog::unknown;
  std::optional<SetupFault> fault_;
  std::uint32_t abort_code_ = 0;
  ObjectId fault_object_;
};

}  // namespace takt::drivers::cia402
