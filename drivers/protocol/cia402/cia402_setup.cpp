// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/cia402/cia402_setup.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "drivers/protocol/drive_timeout.hpp"

namespace takt::drivers::cia402 {
namespace {

enum class Action : std::uint8_t {
  write,             // refused as not to be written: read, and judged
  write_if_there,    // the same, but a drive without this object needs no telling
  write_if_lets,     // a later row sees to it
  compare,           // read, and judge
  compare_if_there,  // the same, but a drive without this object is taken at the robot file's word
  await,             // read until it is so
  identify,          // read, and judged where the robot file names it
  show,              // a text, read for the drive card: whatever comes of it
};

// Which drives a row is for.
enum class For : std::uint8_t {
  all,
  has_deadline,       // 1400:05 is there
  watches_heartbeat,  // it is not
  cst,
  own_loop,           // csp, csv
  watches_following,  // csp, with a window of ours
  keeps_following,    // csp, without
  csv,
};

bool same(std::uint32_t expected, std::uint32_t found) {
  return expected == found;
}

struct Row {
  Action action;
  ObjectId object;
  unsigned bytes;
  std::uint32_t (*value)(const SetupValues&);
  bool (*fits)(std::uint32_t expected, std::uint32_t found) = same;
  For whom = For::all;
};

// In a COB-ID object: the PDO is off; and, for TPDOs, not to be asked for with remote frames.
constexpr std::uint32_t kOff = 0x8000'0000, kNoRemote = 0x4000'0000;

template <std::uint32_t kValue>
constexpr std::uint32_t fixed(const SetupValues&) {
  return kValue;
}
template <std::uint32_t kFlags>
constexpr std::uint32_t with_node(const SetupValues& values) {
  return kFlags + values.node;
}
template <std::size_t kEntry>
std::uint32_t rpdo_entry(const SetupValues& values) {
  return rpdo_map(values.mode)[kEntry];
}
std::uint32_t mode_value(const SetupValues& values) {
  return mode_of_operation(values.mode);
}
// Object 6502 has a bit per mode, from mode 1 on.
std::uint32_t mode_bit(const SetupValues& values) {
  return 1U << (mode_of_operation(values.mode) - 1U);
}
std::uint32_t period_value(const SetupValues& values) {
  return values.period.value;
}
std::uint32_t period_exponent(const SetupValues& values) {
  return static_cast<std::uint8_t>(values.period.exponent);
}
std::uint32_t not_named(const SetupValues& /*values*/) {
  return 0;
}
std::uint32_t rated_torque(const SetupValues& values) {
  return values.rated_torque_mNm;
}
std::uint32_t max_torque(const SetupValues& values) {
  return values.max_torque_per_mille;
}
std::uint32_t following_window(const SetupValues& values) {
  return values.following_window;
}
std::uint32_t following_timeout(const SetupValues& values) {
  return values.following_timeout_ms;
}
constexpr std::uint32_t in_ms(Duration duration) {
  return static_cast<std::uint32_t>(duration.ns / 1'000'000);
}
// Object 60A9: power of ten, unit, per which time, reserved. B5 counts, B4 turns; 03 second, 47 minute.
std::uint32_t velocity_unit(const SetupValues& values) {
  switch (values.velocity_unit) {
    case config::Cia402VelocityUnit::counts_per_s:
      return 0x00B5'0300;
    case config::Cia402VelocityUnit::rpm:
      return 0x00B4'4700;
    case config::Cia402VelocityUnit::tenth_rpm:
      return 0xFFB4'4700;
    case config::Cia402VelocityUnit::hundredth_rpm:
      return 0xFEB4'4700;
    case config::Cia402VelocityUnit::thousandth_rpm:
      return 0xFDB4'4700;
  }
  return 0;
}

constexpr std::uint32_t mask_of(unsigned bytes) {
  return bytes >= 4 ? 0xFFFF'FFFFU : (1U << 8U * bytes) - 1U;
}

// What was read, against what it should be.
bool same_profile(std::uint32_t expected, std::uint32_t found) {
  return (found & 0xFFFFU) == expected;
}
bool has_bits(std::uint32_t expected, std::uint32_t found) {
  return (found & expected) == expected;
}
// Existence and 11-bit id; whether remote frames are answered does not matter.
bool same_pdo(std::uint32_t expected, std::uint32_t found) {
  constexpr std::uint32_t kMeant = kOff | 0x1FFF'FFFF;
  return (found & kMeant) == (expected & kMeant);
}
bool same_unit(std::uint32_t expected, std::uint32_t found) {
  return found >> 8U == expected >> 8U;
}
bool within_half_a_percent(std::uint32_t expected, std::uint32_t found) {
  const std::uint32_t apart = std::max(expected, found) - std::min(expected, found);
  return std::uint64_t{apart} * 200 <= expected;
}
bool at_most(std::uint32_t expected, std::uint32_t found) {
  return found > 0 && found <= expected;
}
bool is_deadline(std::uint32_t /*expected*/, std::uint32_t found) {
  return found > 0 && found <= in_ms(kLongestDriveTimeout);
}
bool watches_us(std::uint32_t expected, std::uint32_t found) {
  return found >> 16U == expected >> 16U && is_deadline(expected, found & 0xFFFFU);
}
// 0 is none; 1 fault, 2 disable voltage, 3 quick stop.
bool is_reaction(std::uint32_t /*expected*/, std::uint32_t found) {
  return found >= 1 && found <= 3;
}

constexpr ObjectId kDeadline{0x1400, 5}, kHeartbeatWatch{0x1016, 1}, kAbortConnection{0x6007, 0}, kMaxTorque{0x6072, 0},
    kFollowingWindow{0x6065, 0}, kFollowingTimeout{0x6066, 0};
constexpr std::uint16_t kIdentity = 0x1018;
constexpr std::uint32_t kDriveProfile = 402;  // in the lower half of 1000

bool is_about_watchdog(ObjectId object) noexcept {
  return object == kDeadline || object == kHeartbeatWatch || object == kAbortConnection;
}

// Order matters: a PDO is off while its map changes, and a map is empty while its entries change.
constexpr Row kScript[] = {
    {Action::compare, {0x1000, 0}, 4, fixed<kDriveProfile>, same_profile},
    {Action::identify, {kIdentity, 1}, 4, not_named},
    {Action::identify, {kIdentity, 2}, 4, not_named},
    {Action::identify, {kIdentity, 3}, 4, not_named},
    {Action::identify, {kIdentity, 4}, 4, not_named},
    {Action::show, {0x100A, 0}, 4, not_named},
    {Action::compare_if_there, {0x6502, 0}, 4, mode_bit, has_bits},
    {Action::write_if_lets, {0x1400, 1}, 4, with_node<kOff + kRpdo1Id>},
    {Action::write_if_lets, {0x1600, 0}, 1, fixed<0>},
    {Action::write, {0x1600, 1}, 4, rpdo_entry<0>},
    {Action::write, {0x1600, 2}, 4, rpdo_entry<1>},
    {Action::write, {0x1600, 3}, 4, rpdo_entry<2>},
    {Action::write, {0x1600, 0}, 1, fixed<3>},
    {Action::write, {0x1400, 2}, 1, fixed<1>},  // taken over at every SYNC
    {Action::write_if_there, kDeadline, 2, fixed<in_ms(kCommandDeadline)>, is_deadline},
    {Action::compare, kDeadline, 2, fixed<in_ms(kCommandDeadline)>, is_deadline, For::has_deadline},
    {Action::write, kHeartbeatWatch, 4, fixed<kHostNode << 16U | in_ms(kCommandDeadline)>, watches_us,
     For::watches_heartbeat},
    {Action::compare, kHeartbeatWatch, 4, fixed<kHostNode << 16U | in_ms(kCommandDeadline)>, watches_us,
     For::watches_heartbeat},
    {Action::write, kAbortConnection, 2, fixed<1>, is_reaction, For::watches_heartbeat},
    {Action::compare, kAbortConnection, 2, fixed<1>, is_reaction, For::watches_heartbeat},
    {Action::write, {0x1400, 1}, 4, with_node<kRpdo1Id>, same_pdo},
    {Action::write_if_lets, {0x1800, 1}, 4, with_node<kOff + kNoRemote + kTpdo1Id>},
    {Action::write_if_lets, {0x1A00, 0}, 1, fixed<0>},
    {Action::write, {0x1A00, 1}, 4, fixed<kTpdoMap[0]>},
    {Action::write, {0x1A00, 2}, 4, fixed<kTpdoMap[1]>},
    {Action::write, {0x1A00, 3}, 4, fixed<kTpdoMap[2]>},
    {Action::write, {0x1A00, 0}, 1, fixed<3>},
    {Action::write, {0x1800, 2}, 1, fixed<1>},  // sent at every SYNC
    {Action::write, {0x1800, 1}, 4, with_node<kNoRemote + kTpdo1Id>, same_pdo},
    // What drives send by default and no part reads.
    {Action::write_if_there, {0x1801, 1}, 4, with_node<kOff + kNoRemote + kTpdo2Id>, same_pdo},
    {Action::write_if_there, {0x1802, 1}, 4, with_node<kOff + kNoRemote + kTpdo3Id>, same_pdo},
    {Action::write_if_there, {0x1803, 1}, 4, with_node<kOff + kNoRemote + kTpdo4Id>, same_pdo},
    {Action::write, {0x1017, 0}, 2, fixed<in_ms(kHeartbeatPeriod)>},
    {Action::write, {0x6060, 0}, 1, mode_value},
    {Action::await, {0x6061, 0}, 1, mode_value},
    {Action::write, {0x60C2, 1}, 1, period_value},
    {Action::write, {0x60C2, 2}, 1, period_exponent},
    {Action::compare_if_there, {0x60A9, 0}, 4, velocity_unit, same_unit, For::csv},
    {Action::compare, {0x6076, 0}, 4, rated_torque, within_half_a_percent},
    {Action::write_if_there, kMaxTorque, 2, max_torque, at_most, For::cst},
    {Action::write, kMaxTorque, 2, max_torque, at_most, For::own_loop},
    {Action::compare_if_there, kMaxTorque, 2, max_torque, at_most},
    {Action::write_if_there, kFollowingWindow, 4, following_window, same, For::watches_following},
    {Action::write_if_there, kFollowingTimeout, 2, following_timeout, same, For::watches_following},
    {Action::compare_if_there, kFollowingWindow, 4, following_window, same, For::watches_following},
    {Action::compare_if_there, kFollowingTimeout, 2, following_timeout, same, For::watches_following},
    {Action::show, kFollowingWindow, 4, not_named, same, For::keeps_following},
    {Action::show, kFollowingTimeout, 2, not_named, same, For::keeps_following},
};

struct Abort {
  std::uint32_t code;
  const char* text;
};
// CiA 301, SDO abort codes.
constexpr std::array kAborts{
    Abort{0x0503'0000, "toggle bit not alternated"},
    Abort{0x0504'0000, "protocol timed out"},
    Abort{0x0504'0001, "command not known"},
    Abort{0x0504'0005, "out of memory"},
    Abort{0x0601'0000, "access not supported"},
    Abort{0x0601'0001, "can only be written"},
    Abort{0x0601'0002, "can only be read"},
    Abort{0x0602'0000, "no such object"},
    Abort{0x0604'0041, "cannot be mapped into a PDO"},
    Abort{0x0604'0042, "more than a PDO holds"},
    Abort{0x0604'0043, "parameters do not go together"},
    Abort{0x0604'0047, "does not go with the inside of the device"},
    Abort{0x0606'0000, "hardware error"},
    Abort{0x0607'0010, "wrong length"},
    Abort{0x0607'0012, "too long"},
    Abort{0x0607'0013, "too short"},
    Abort{0x0609'0011, "no such sub-index"},
    Abort{0x0609'0030, "value out of range"},
    Abort{0x0609'0031, "value too high"},
    Abort{0x0609'0032, "value too low"},
    Abort{0x0609'0036, "maximum below minimum"},
    Abort{0x0800'0000, "general error"},
    Abort{0x0800'0020, "cannot be taken over or stored"},
    Abort{0x0800'0021, "not while the device is controlled locally"},
    Abort{0x0800'0022, "not in the present state of the device"},
    Abort{0x0800'0023, "no object dictionary"},
};
static_assert(kAborts.size() < kOtherAbort);

bool says_absent(std::uint32_t abort_code) noexcept {
  return abort_code == kAbortNoSuchObject || abort_code == kAbortNoSuchSubIndex;
}
bool says_not_to_be_written(std::uint32_t abort_code) noexcept {
  constexpr std::uint32_t kNotSupported = 0x0601'0000, kReadOnly = 0x0601'0002;
  return abort_code == kNotSupported || abort_code == kReadOnly;
}

}  // namespace

std::uint32_t abort_number(std::uint32_t abort_code) noexcept {
  if (abort_code == 0) return 0;
  for (std::uint32_t i = 0; i < kAborts.size(); ++i)
    if (kAborts[i].code == abort_code) return i + 1;
  return kOtherAbort;
}

std::string abort_text(std::uint32_t number) {
  if (number == 0 || number > kAborts.size()) return "an abort code of the maker's own";
  const Abort& abort = kAborts[number - 1];
  std::array<char, 80> text{};
  std::snprintf(text.data(), text.size(), "%08X, %s", abort.code, abort.text);
  return text.data();
}

std::optional<InterpolationPeriod> interpolation_period(Duration period) noexcept {
  std::int64_t unit_ns = 1'000'000'000;
  for (std::int8_t exponent = 0; exponent >= -6; --exponent, unit_ns /= 10)
    if (period.ns > 0 && period.ns % unit_ns == 0 && period.ns / unit_ns <= 255)
      return InterpolationPeriod{static_cast<std::uint8_t>(period.ns / unit_ns), exponent};
  return std::nullopt;
}

void Setup::restart() noexcept {
  phase_ = Phase::stopping;
  row_ = 0;
  asked_ = waiting_ = 0;
  refusal_ = segments_ = 0;
  text_ = Text::none;
  differed_ = false;
}

std::optional<CanFrame> Setup::tick() noexcept {
  switch (phase_) {
    case Phase::stopping:
      phase_ = Phase::asking;
      return encode_nmt(NmtCommand::pre_operational, values_.node);
    case Phase::asking:
    case Phase::starting:
      return ask();
    case Phase::pausing:
      if (--waiting_ == 0) restart();
      return std::nullopt;
    case Phase::done:
      return std::nullopt;
  }
  return std::nullopt;
}

std::optional<CanFrame> Setup::ask() noexcept {
  if (waiting_ > 0) {
    --waiting_;
    return std::nullopt;
  }
  if (text_ == Text::too_long) {
    const ObjectId object = kScript[row_].object;
    next();
    return encode_sdo_abort(values_.node, object);
  }
  if (asked_ == patience_.tries) {
    give_up(differed_ ? SetupFault::settings_differ : SetupFault::settings_unread);
    return std::nullopt;
  }
  ++asked_;
  waiting_ = patience_.answer_ticks - 1;
  return question();
}

bool Setup::reads() const noexcept {
  switch (kScript[row_].action) {
    case Action::write:
    case Action::write_if_there:
    case Action::write_if_lets:
      return refusal_ != 0;
    case Action::compare:
    case Action::compare_if_there:
    case Action::await:
    case Action::identify:
    case Action::show:
      return true;
  }
  return true;
}

// Of the row that identifies: what the robot file wants to read there.
std::optional<std::uint32_t> Setup::named() const noexcept {
  const DriveWords& identity = values_.identity;
  const auto word = [](const DriveWords& words, std::size_t i) {
    return i < words.count ? std::optional(words.word[i]) : std::nullopt;
  };
  switch (kScript[row_].object.sub) {
    case 1:
      return word(identity, 0);
    case 2:
      return word(identity, 1);
    case 3:
      return word(values_.revision, 0);
    default:
      return word(identity, 2);
  }
}

bool Setup::row_applies() const noexcept {
  switch (kScript[row_].whom) {
    case For::all:
      return true;
    case For::has_deadline:
      return watchdog_ == Watchdog::deadline;
    case For::watches_heartbeat:
      return watchdog_ == Watchdog::heartbeat;
    case For::cst:
      return values_.mode == config::Cia402Mode::cst;
    case For::own_loop:
      return values_.mode != config::Cia402Mode::cst;
    case For::keeps_following:
      return values_.mode == config::Cia402Mode::csp && values_.following_window == 0;
    case For::watches_following:
      return values_.mode == config::Cia402Mode::csp && values_.following_window != 0;
    case For::csv:
      return values_.mode == config::Cia402Mode::csv;
  }
  return true;
}

CanFrame Setup::question() const noexcept {
  if (phase_ == Phase::starting) return encode_nmt(NmtCommand::start, values_.node);
  const Row& row = kScript[row_];
  if (text_ == Text::coming) return encode_sdo_segment_request(values_.node, segments_ % 2 != 0);
  if (reads()) return encode_sdo_read(values_.node, row.object);
  return encode_sdo_write(values_.node, row.object, row.value(values_), row.bytes);
}

void Setup::take(const SdoAnswer& answer) noexcept {
  // Not what was asked: the late answer to a question that was asked twice.
  if (phase_ != Phase::asking || asked_ == 0 || answer.object != kScript[row_].object) return;
  switch (answer.kind) {
    case SdoAnswer::Kind::aborted:
      return take_abort(answer.value);
    case SdoAnswer::Kind::segmented:
      if (kScript[row_].action != Action::show || text_ != Text::none) return;
      text_ = Text::coming;
      asked_ = waiting_ = 0;
      return;
    case SdoAnswer::Kind::value:
      if (reads()) take_value(answer.is_sized ? answer.value : answer.value & mask_of(kScript[row_].bytes));
      return;
    case SdoAnswer::Kind::written:
      if (reads()) return;
      if (kScript[row_].object == kDeadline) watchdog_ = Watchdog::deadline;
      return next();
  }
}

void Setup::take(const SdoSegment& segment) noexcept {
  // Another toggle: the late answer to a question that was asked twice.
  if (phase_ != Phase::asking || asked_ == 0 || text_ != Text::coming || segment.toggle != (segments_ % 2 != 0)) return;
  asked_ = waiting_ = 0;
  ++segments_;
  if (segment.last) return next();
  if (segments_ == kTextSegments) text_ = Text::too_long;
}

void Setup::take_value(std::uint32_t found) noexcept {
  const Row& row = kScript[row_];
  if (row.action == Action::show) return next();
  if (row.action == Action::identify) {
    if (found == named().value_or(found)) return next();
    return give_up(SetupFault::settings_differ, 0);
  }
  if (row.fits(row.value(values_), found)) {
    if (row.object == kDeadline) watchdog_ = Watchdog::deadline;
    return next();
  }
  if (row.action == Action::await) {
    differed_ = true;
    return;
  }
  give_up(refusal_ != 0 ? SetupFault::setup_refused : SetupFault::settings_differ, refusal_);
}

void Setup::take_abort(std::uint32_t code) noexcept {
  const Action action = kScript[row_].action;
  const bool optional = action == Action::write_if_there || action == Action::compare_if_there;
  if (action == Action::show) return next();
  if (refusal_ != 0) return give_up(SetupFault::setup_refused, refusal_);
  if (action == Action::identify) return give_up(SetupFault::settings_unread, code);
  if (says_absent(code) && optional) {
    if (kScript[row_].object == kDeadline) watchdog_ = Watchdog::heartbeat;
    return next();
  }
  if (action == Action::write_if_lets) return next();
  if (says_not_to_be_written(code) && !reads()) {
    refusal_ = code;
    asked_ = waiting_ = 0;
    return;
  }
  give_up(SetupFault::setup_refused, code);
}

std::uint32_t Setup::error_code() const noexcept {
  if (!fault_) return 0;
  return setup_fault_code(*fault_, {fault_object_.index, fault_object_.sub, abort_number(abort_code_)});
}

void Setup::take_operational() noexcept {
  if (phase_ != Phase::starting || asked_ == 0) return;
  phase_ = Phase::done;
  fault_.reset();
}

void Setup::next() noexcept {
  asked_ = waiting_ = 0;
  refusal_ = segments_ = 0;
  text_ = Text::none;
  differed_ = false;
  do {
    if (++row_ == std::size(kScript)) {
      phase_ = Phase::starting;
      return;
    }
  } while (!row_applies());
}

void Setup::give_up(SetupFault fault, std::uint32_t abort_code) noexcept {
  const bool asking = phase_ == Phase::asking;
  const bool about_watchdog = asking && is_about_watchdog(kScript[row_].object);
  if (about_watchdog && values_.watchdog_waived) return next();
  if (asking && kScript[row_].action == Action::show) return next();
  if (asking && fault == SetupFault::settings_unread && kScript[row_].action == Action::identify && !named())
    return next();
  fault_ = about_watchdog && fault != SetupFault::settings_unread ? SetupFault::watchdog_off : fault;
  fault_object_ = asking ? kScript[row_].object : ObjectId{};
  abort_code_ = abort_code;
  phase_ = Phase::pausing;
  waiting_ = patience_.pause_ticks;
}

}  // namespace takt::drivers::cia402
