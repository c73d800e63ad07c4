#include "drivers/protocol/cia402/cia402_setup.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

namespace takt::drivers::cia402 {
namespace {

enum class Action : std::uint8_t {
  write,
  write_if_there,  // a drive without this object needs no telling
  compare,         // read, and judge
};

struct Row {
  Action action;
  ObjectId object;
  unsigned bytes;
  std::uint32_t (*value)(const SetupValues&);
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
std::uint32_t period_value(const SetupValues& values) {
  return values.period.value;
}
std::uint32_t period_exponent(const SetupValues& values) {
  return static_cast<std::uint8_t>(values.period.exponent);
}
std::uint32_t rated_torque(const SetupValues& values) {
  return values.rated_torque_mNm;
}
constexpr std::uint32_t in_ms(Duration duration) {
  return static_cast<std::uint32_t>(duration.ns / 1'000'000);
}

constexpr ObjectId kDeviceType{0x1000, 0}, kRatedTorque{0x6076, 0}, kDeadline{0x1400, 5};
constexpr std::uint32_t kDriveProfile = 402;  // in the lower half of 1000

// Order matters: a PDO is off while its map changes, and a map is empty while its entries change.
constexpr Row kScript[] = {
    {Action::compare, kDeviceType, 4, fixed<kDriveProfile>},
    {Action::write, {0x1400, 1}, 4, with_node<kOff + kRpdo1Id>},
    {Action::write, {0x1600, 0}, 1, fixed<0>},
    {Action::write, {0x1600, 1}, 4, rpdo_entry<0>},
    {Action::write, {0x1600, 2}, 4, rpdo_entry<1>},
    {Action::write, {0x1600, 3}, 4, rpdo_entry<2>},
    {Action::write, {0x1600, 0}, 1, fixed<3>},
    {Action::write, {0x1400, 2}, 1, fixed<1>},  // taken over at every SYNC
    {Action::write, kDeadline, 2, fixed<in_ms(kCommandDeadline)>},
    {Action::compare, kDeadline, 2, fixed<in_ms(kCommandDeadline)>},
    {Action::write, {0x1400, 1}, 4, with_node<kRpdo1Id>},
    {Action::write, {0x1800, 1}, 4, with_node<kOff + kNoRemote + kTpdo1Id>},
    {Action::write, {0x1A00, 0}, 1, fixed<0>},
    {Action::write, {0x1A00, 1}, 4, fixed<kTpdoMap[0]>},
    {Action::write, {0x1A00, 2}, 4, fixed<kTpdoMap[1]>},
    {Action::write, {0x1A00, 3}, 4, fixed<kTpdoMap[2]>},
    {Action::write, {0x1A00, 0}, 1, fixed<3>},
    {Action::write, {0x1800, 2}, 1, fixed<1>},  // sent at every SYNC
    {Action::write, {0x1800, 1}, 4, with_node<kNoRemote + kTpdo1Id>},
    // What drives send by default and nobody reads.
    {Action::write_if_there, {0x1801, 1}, 4, with_node<kOff + kNoRemote + kTpdo2Id>},
    {Action::write_if_there, {0x1802, 1}, 4, with_node<kOff + kNoRemote + kTpdo3Id>},
    {Action::write_if_there, {0x1803, 1}, 4, with_node<kOff + kNoRemote + kTpdo4Id>},
    {Action::write, {0x1017, 0}, 2, fixed<in_ms(kHeartbeatPeriod)>},
    {Action::write, {0x6060, 0}, 1, mode_value},
    {Action::write, {0x60C2, 1}, 1, period_value},
    {Action::write, {0x60C2, 2}, 1, period_exponent},
    {Action::compare, kRatedTorque, 4, rated_torque},
};

SetupFault fault_of(const Row& row) noexcept {
  return row.object == kDeadline ? SetupFault::watchdog_off : SetupFault::settings_differ;
}

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

bool is_as_expected(const Row& row, std::uint32_t expected, std::uint32_t found) noexcept {
  if (row.object == kDeviceType) return (found & 0xFFFFU) == expected;
  const std::uint32_t apart = std::max(expected, found) - std::min(expected, found);
  return std::uint64_t{apart} * 200 <= expected;
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
  if (asked_ == patience_.tries) {
    give_up(SetupFault::settings_unread);
    return std::nullopt;
  }
  ++asked_;
  waiting_ = patience_.answer_ticks - 1;
  return question();
}

CanFrame Setup::question() const noexcept {
  if (phase_ == Phase::starting) return encode_nmt(NmtCommand::start, values_.node);
  const Row& row = kScript[row_];
  if (row.action == Action::compare) return encode_sdo_read(values_.node, row.object);
  return encode_sdo_write(values_.node, row.object, row.value(values_), row.bytes);
}

void Setup::take(const SdoAnswer& answer) noexcept {
  // Not what was asked: the late answer to a question that was asked twice.
  if (phase_ != Phase::asking || asked_ == 0 || answer.object != kScript[row_].object) return;
  const Row& row = kScript[row_];
  const bool reads = row.action == Action::compare;
  switch (answer.kind) {
    case SdoAnswer::Kind::aborted:
      return take_abort(answer);
    case SdoAnswer::Kind::value:
      if (!reads) return;
      if (!is_as_expected(row, row.value(values_), answer.value)) return give_up(fault_of(row));
      return next();
    case SdoAnswer::Kind::written:
      if (!reads) next();
      return;
  }
}

void Setup::take_abort(const SdoAnswer& answer) noexcept {
  const bool absent = answer.value == kAbortNoSuchObject || answer.value == kAbortNoSuchSubIndex;
  if (absent && kScript[row_].action == Action::write_if_there) return next();
  give_up(SetupFault::setup_refused);
  abort_code_ = answer.value;
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
  if (++row_ == std::size(kScript)) phase_ = Phase::starting;
}

void Setup::give_up(SetupFault fault) noexcept {
  fault_ = fault;
  fault_object_ = phase_ == Phase::asking ? kScript[row_].object : ObjectId{};
  abort_code_ = 0;
  phase_ = Phase::pausing;
  waiting_ = patience_.pause_ticks;
}

}  // namespace takt::drivers::cia402
