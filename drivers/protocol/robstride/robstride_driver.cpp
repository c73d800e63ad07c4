// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/robstride/robstride_driver.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

namespace takt::drivers {
namespace {

constexpr std::uint32_t kTicksPerStep = 4;    // several drives that ask at once must not crowd the bus
constexpr std::uint32_t kTicksToRetry = 500;  // from a failure to the next attempt
constexpr int kTries = 10;
constexpr std::uint32_t kMotionMode = 0;
constexpr std::uint32_t kReportedBits = 0x7F'FFFF;
constexpr std::string_view kCyberGear = "CyberGear";

bool is_positive(float x) {
  return std::isfinite(x) && x > 0;
}

}  // namespace

std::optional<RobstrideSetup::Step> RobstrideSetup::next(RobstrideAddress address) noexcept {
  using enum RobstrideParameter;
  ++tick_;
  if (stage_ == Stage::failed && tick_ >= kTicksToRetry) restart();
  // Numbers on a bus differ, and with them the ticks in which their drives are asked.
  if (tick_ % kTicksPerStep != address.drive % kTicksPerStep) return std::nullopt;
  if (tries_ == kTries) give_up();
  switch (stage_) {
    case Stage::set_mode:
      stage_ = Stage::ask_mode;
      return Step{encode_robstride_setting(address, run_mode, kMotionMode), true};
    case Stage::ask_mode:
      ++tries_;
      // No answer: it may be the setting that was lost.
      stage_ = Stage::set_mode;
      return Step{encode_robstride_question(address, run_mode), false};
    case Stage::set_timeout:
      stage_ = Stage::ask_timeout;
      return Step{encode_robstride_setting(address, can_timeout, wish_.units), true};
    case Stage::ask_timeout:
      ++tries_;
      stage_ = Stage::set_timeout;
      return Step{encode_robstride_question(address, can_timeout), false};
    case Stage::ask_stored:
      ++tries_;
      return Step{encode_robstride_question(address, stored_timeout), false};
    case Stage::ask_zero:
      ++tries_;
      return Step{encode_robstride_question(address, zero_state), false};
    case Stage::ask_identity:
      ++tries_;
      return Step{encode_robstride_get_id(address), false};
    case Stage::done:
    case Stage::failed:
      break;
  }
  return std::nullopt;
}

void RobstrideSetup::restart() noexcept {
  enter(Stage::set_mode);
  tick_ = 0;
  mode_was_read_ = false;
  timeout_.reset();
}

void RobstrideSetup::enter(Stage stage) noexcept {
  stage_ = stage;
  tries_ = 0;
  if (stage == Stage::done) error_code_ = 0;
}

void RobstrideSetup::fail(SetupFault fault, std::uint32_t setting) noexcept {
  enter(Stage::failed);
  tick_ = 0;
  error_code_ = setup_fault_code(fault, setting);
}

// The drive was asked often enough.
void RobstrideSetup::give_up() noexcept {
  switch (stage_) {
    case Stage::set_mode:
    case Stage::ask_mode:
      return fail(mode_was_read_ ? SetupFault::setup_refused : SetupFault::settings_unread,
                  RobstrideParameter::run_mode);
    case Stage::set_timeout:
    case Stage::ask_timeout:
      if (timeout_) return judge_timeout(RobstrideParameter::can_timeout);
      return enter(Stage::ask_stored);
    case Stage::ask_stored:
      return judge_timeout(RobstrideParameter::stored_timeout);
    case Stage::ask_zero:
      return enter(Stage::ask_identity);
    case Stage::ask_identity:
      if (identity_.count == 0) return enter(Stage::done);
      return fail(SetupFault::settings_unread, kRobstrideIdentity);
    case Stage::done:
    case Stage::failed:
      return;
  }
}

void RobstrideSetup::judge_timeout(RobstrideParameter which) noexcept {
  if (wish_.waived || is_watchdog(timeout_)) return go_on_from_timeout();
  fail(timeout_ ? SetupFault::watchdog_off : SetupFault::watchdog_unknown, which);
}

void RobstrideSetup::take(const RobstrideAnswer& answer) noexcept {
  switch (static_cast<RobstrideParameter>(answer.index)) {
    case RobstrideParameter::run_mode:
      return take_mode(answer);
    case RobstrideParameter::can_timeout:
    case RobstrideParameter::stored_timeout:
      return take_timeout(answer);
    case RobstrideParameter::zero_state:
      return take_zero(answer);
  }
}

void RobstrideSetup::take_mode(const RobstrideAnswer& answer) noexcept {
  if ((stage_ != Stage::set_mode && stage_ != Stage::ask_mode) || tries_ == 0 || answer.failed) return;
  mode_was_read_ = true;
  if ((answer.value & 0xFFU) == kMotionMode) enter(wish_.has_volatile ? Stage::set_timeout : Stage::ask_stored);
}

// A failed answer has no value: what is not there is asked for elsewhere, or stays unknown.
void RobstrideSetup::take_timeout(const RobstrideAnswer& answer) noexcept {
  if (tries_ == 0) return;
  const bool about_volatile = static_cast<RobstrideParameter>(answer.index) == RobstrideParameter::can_timeout;
  if (about_volatile && (stage_ == Stage::set_timeout || stage_ == Stage::ask_timeout)) {
    if (answer.failed) return enter(Stage::ask_stored);
    timeout_ = answer.value;
    // Another value: the setting was lost, or is not obeyed. Again, and in the end give_up() judges what is there.
    if (answer.value == wish_.units) go_on_from_timeout();
  } else if (!about_volatile && stage_ == Stage::ask_stored) {
    if (!answer.failed) timeout_ = answer.value;
    judge_timeout(RobstrideParameter::stored_timeout);
  }
}

void RobstrideSetup::take_zero(const RobstrideAnswer& answer) noexcept {
  if (stage_ != Stage::ask_zero || tries_ == 0) return;
  const bool begins_at_zero = !answer.failed && (answer.value & 0xFFU) == 0;
  if (begins_at_zero && begins_below_zero_) return fail(SetupFault::settings_differ, RobstrideParameter::zero_state);
  enter(Stage::ask_identity);
}

void RobstrideSetup::take(const RobstrideIdentity& told) noexcept {
  if (stage_ != Stage::ask_identity) return;
  if (!agrees(identity_, {{told.first, told.second}, 2})) return fail(SetupFault::settings_differ, kRobstrideIdentity);
  enter(Stage::done);
}

std::size_t RobstrideDriver::encode(bool enable, const DriveSetpoint& setpoint, MonoTime /*now*/,
                                    MonoTime /*valid_until*/, std::span<CanFrame> out) noexcept {
  // The protocol has no field for the command's remaining life: the drive's own time-out stands in.
  if (wish_ != Wish::drive && ++silent_ticks_ == kTicksToDoubt) setup_.restart();
  if (!enable && wish_ != Wish::disable) setup_.restart();
  if (!enable || !setup_.may_enable()) return encode_standby(out);
  if (wish_ == Wish::enter && feedback_.drive_state == DriveState::enabled) wish_ = Wish::drive;
  if (wish_ != Wish::drive) {
    wish_ = Wish::enter;
    out[0] = encode_robstride_enable(settings_.address);
    return 1;
  }
  const DriveSetpoint motor = to_motor(settings_.mapping, setpoint);
  out[0] = encode_robstride_motion(settings_.range, settings_.address,
                                   {.p = motor.q, .v = motor.dq, .kp = motor.kp, .kd = motor.kd, .t = motor.tau});
  return 1;
}

std::size_t RobstrideDriver::encode_standby(std::span<CanFrame> out) noexcept {
  wish_ = Wish::disable;
  clear_next_ = (faults_ | reported_faults_) != 0 && !clear_next_;
  clear_sent_ |= clear_next_;
  out[0] = encode_robstride_stop(settings_.address, clear_next_);
  // A drive that is silent has nothing to answer, and one that runs takes no other mode.
  if (!heard_ || mode_ != RobstrideMode::reset) return 1;
  heard_ = false;
  const std::optional<RobstrideSetup::Step> step = setup_.next(settings_.address);
  judge();
  if (!step) return 1;
  const std::size_t place = step->instead_of_stop ? 0 : 1;
  out[place] = step->frame;
  return place + 1;
}

bool RobstrideDriver::decode(const ReceivedFrame& received) noexcept {
  const CanFrame& frame = received.frame;
  const std::optional<RobstrideKind> kind = robstride_kind(settings_.address, frame);
  if (!kind) return false;
  const auto taken = [this](const auto& decoded, auto&&... more) {
    if (decoded)
      take(*decoded, more...);
    else
      ++malformed_frames_;
    return decoded.has_value();
  };
  switch (*kind) {
    case RobstrideKind::feedback:
      return taken(decode_robstride_feedback(settings_.range, frame), received.received_at);
    case RobstrideKind::fault_report:
      return taken(decode_robstride_fault_report(frame));
    case RobstrideKind::answer:
      return taken(decode_robstride_answer(frame));
    case RobstrideKind::identity:
      return taken(decode_robstride_identity(frame));
    case RobstrideKind::active_report:  // not an answer: counted, it would look like two drives with one number
      return true;
  }
  return false;
}

void RobstrideDriver::take(const RobstrideFeedback& feedback, MonoTime received_at) noexcept {
  take_reading(settings_.mapping, feedback.p, feedback.v, feedback.t, received_at, feedback_);
  feedback_.temperature_C = feedback.temperature_C;
  mode_ = feedback.mode;
  faults_ = feedback.faults;
  heard_ = true;
  silent_ticks_ = 0;
  // Some of a report's faults have no bit in feedback: they count as gone once cleared and not reported again.
  if (clear_sent_ && faults_ == 0) reported_faults_ = 0;
  judge();
}

void RobstrideDriver::take(const RobstrideFaultReport& report) noexcept {
  reported_faults_ = report.faults;
  clear_sent_ = false;
  judge();
}

void RobstrideDriver::take(const RobstrideAnswer& answer) noexcept {
  setup_.take(answer);
  judge();
}

void RobstrideDriver::take(const RobstrideIdentity& told) noexcept {
  setup_.take(told);
  judge();
}

void RobstrideDriver::judge() noexcept {
  if (!feedback_.received_at.is_set()) return;
  const bool faulty = faults_ != 0 || reported_faults_ != 0;
  feedback_.error_code = faulty ? faults_ | (reported_faults_ & kReportedBits) << 8U : setup_.error_code();
  if (faulty || feedback_.error_code != 0) {
    feedback_.drive_state = DriveState::fault;
    return;
  }
  switch (mode_) {
    case RobstrideMode::reset:
    case RobstrideMode::calibration:
      feedback_.drive_state = DriveState::disabled;
      break;
    case RobstrideMode::running:
      feedback_.drive_state = DriveState::enabled;
      break;
    case RobstrideMode::reserved:
      feedback_.drive_state = DriveState::unknown;
      break;
  }
}

std::optional<Duration> RobstrideDriver::stored_timeout() const {
  const std::optional<std::uint32_t> units = setup_.timeout();
  if (!units) return std::nullopt;
  return kTimeoutUnit * *units;
}

bool begins_below_zero(const config::Joint& joint) {
  const config::Drive& drive = joint.drive;
  const double one_end = (joint.limits.q_min - drive.offset) * drive.direction;
  const double other_end = (joint.limits.q_max - drive.offset) * drive.direction;
  return drive.position_after_power_up == config::PositionAfterPowerUp::absolute && std::min(one_end, other_end) < 0;
}

std::expected<std::unique_ptr<JointDriver>, std::string> make_robstride_driver(const config::RobotConfig& robot,
                                                                               std::size_t joint) {
  const config::Drive& drive = robot.joints[joint].drive;
  RobstrideDriveSettings settings;
  settings.range = {static_cast<float>(drive.position_range), static_cast<float>(drive.velocity_range),
                    static_cast<float>(drive.kp_range), static_cast<float>(drive.kd_range),
                    static_cast<float>(drive.torque_range)};
  const RobstrideRange& range = settings.range;
  if (!is_positive(range.p) || !is_positive(range.v) || !is_positive(range.kp) || !is_positive(range.kd) ||
      !is_positive(range.t))
    return std::unexpected("the drive's packed ranges are not all positive: name a model or give every range");
  if (drive.id < 1 || drive.id > 127) return std::unexpected("robstride drives are numbered 1 to 127: correct id");
  if (drive.host_id < 128 || drive.host_id > 253)
    return std::unexpected("host_id must lie beyond every drive's number and below 254: 253 is usual");
  settings.address = {static_cast<std::uint8_t>(drive.id), static_cast<std::uint8_t>(drive.host_id)};
  settings.mapping = mapping_of(drive);
  settings.timeout = {.units = timeout_units(drive_timeout(robot)),
                      .has_volatile = drive.model != kCyberGear,
                      .waived = config::waives_watchdog(drive)};
  const auto identity = words_of("identity", drive.identity, {.style = WordStyle::hex, .least = 2, .most = 2});
  if (!identity) return std::unexpected(identity.error());
  settings.identity = *identity;
  settings.begins_below_zero = begins_below_zero(robot.joints[joint]);
  return std::make_unique<RobstrideDriver>(settings);
}

std::vector<FrameTraffic> robstride_traffic(const config::RobotConfig& /*robot*/, std::size_t /*joint*/) {
  const FrameTraffic frame{.bytes = 8, .extended = true};
  return {frame, frame};
}

namespace {

std::string_view parameter_name(std::uint32_t number) {
  if (number == kRobstrideIdentity) return "identity (unique id, type 0)";
  switch (static_cast<RobstrideParameter>(number)) {
    case RobstrideParameter::run_mode:
      return "run mode (parameter 7005)";
    case RobstrideParameter::can_timeout:
      return "CAN time-out (parameter 7028)";
    case RobstrideParameter::stored_timeout:
      return "CAN time-out (parameter 200C)";
    case RobstrideParameter::zero_state:
      return "where it begins to count (parameter 7029): write 1 into it (-pi to pi) and save it with the maker's "
             "tool, "
             "or write `position_after_power_up: within_a_turn`";
  }
  return "";
}

}  // namespace

std::string robstride_error_name(const config::Drive& drive, std::uint32_t code) {
  struct Bit {
    unsigned number;
    const char* name;
  };
  static constexpr std::array<Bit, 14> kBits{{{0, "under-voltage"},
                                              {1, "over-current"},
                                              {2, "over-temperature"},
                                              {3, "magnetic encoder fault"},
                                              {4, "stall overload"},
                                              {5, "not calibrated"},
                                              {8, "motor over-temperature"},
                                              {9, "driver chip fault"},
                                              {10, "supply under-voltage"},
                                              {11, "supply over-voltage"},
                                              {12, "phase B over-current"},
                                              {13, "phase C over-current"},
                                              {15, "encoder not calibrated"},
                                              {24, "phase A over-current"}}};
  constexpr unsigned kBitFour = 4;  // RobStride and its older CyberGear differ
  constexpr std::uint32_t kOverload = 0xFFU << 16U;
  if (const std::uint32_t setting = setting_of(code); setting != 0) return std::string(parameter_name(setting));
  std::string name;
  const auto add = [&name](const char* one) { name += (name.empty() ? "" : ", ") + std::string(one); };
  for (const Bit& bit : kBits)
    if ((code >> bit.number & 1U) != 0)
      add(bit.number == kBitFour && drive.model == kCyberGear ? "Hall encoder fault" : bit.name);
  if ((code & kOverload) != 0) add("overload");
  return name;
}

}  // namespace takt::drivers
