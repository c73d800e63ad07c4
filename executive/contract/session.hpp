// SPDX-License-Identifier: Apache-2.0
// The first words exchanged on a rendezvous socket, and the operator's requests. Plain structures over SOCK_SEQPACKET;
// strings are zero-terminated and zero-padded. Thread rule: none of this ever reaches the control thread.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <optional>
#include <string_view>
#include <type_traits>

#include "executive/contract/layout.hpp"
#include "executive/contract/mode.hpp"
#include "executive/contract/seat.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt {

// One lease per role and server: a second holder is refused with a sentence that names the first.
// `operator_console` leases are short: a connection per request. `sensor_reader` and `viewer` (who reads what the
// monitor reads, to show it) may be several.
// `fallback_policy` is a second policy, with a mailbox of its own. An input reader reads what a policy's host says of
// its network's inputs (policy_input.hpp), a fallback input reader that of the fallback's. `candidate_policy` runs
// beside the policy, and may be put in its place on a live robot.
enum class Role : std::uint8_t {
  policy,
  monitor,
  operator_console,
  sensor_reader,
  viewer,
  fallback_policy,
  input_reader,
  fallback_input_reader,
  candidate_policy,
  candidate_input_reader
};
inline constexpr std::size_t kRoleCount = 10;

constexpr std::string_view name(Role role) {
  constexpr std::array<std::string_view, kRoleCount> names{"policy",           "monitor",
                                                           "operator",         "sensor reader",
                                                           "viewer",           "fallback policy",
                                                           "input reader",     "fallback input reader",
                                                           "candidate policy", "candidate input reader"};
  const auto index = static_cast<std::size_t>(role);
  return index < names.size() ? names[index] : "invalid";
}

// The roles of each seat: of its policy's host, and of who reads what that host says of its inputs.
inline constexpr PerSeat<Role> kPolicyRoles{{Role::policy, Role::fallback_policy, Role::candidate_policy}};
inline constexpr PerSeat<Role> kInputReaderRoles{
    {Role::input_reader, Role::fallback_input_reader, Role::candidate_input_reader}};
// None: it is a role of no seat.
constexpr std::optional<Seat> seat_of(Role role) {
  for (const Seat seat : kSeats)
    if (role == kPolicyRoles[seat] || role == kInputReaderRoles[seat]) return seat;
  return std::nullopt;
}
constexpr bool is_policy(Role role) {
  const auto seat = seat_of(role);
  return seat && role == kPolicyRoles[*seat];
}
constexpr bool is_input_reader(Role role) {
  return seat_of(role) && !is_policy(role);
}

struct Hello {
  std::uint64_t magic = kMagic;
  std::uint32_t abi_version = kAbiVersion;
  Role role = Role::policy;
  std::uint8_t reserved[3] = {};
  std::uint64_t layout = 0;            // contract_layout()
  std::uint64_t config_hash = 0;       // first 8 bytes of the resolved configuration's SHA-256; 0: not claimed
  std::uint64_t policy_hash = 0;       // policy roles: as in CommandHeader
  std::uint64_t joint_names_hash = 0;  // policy roles: layout-independent hash of the joint names in order
  std::uint32_t joint_count = 0;       // policy roles
  std::uint32_t step_count = 0;        // policy roles
  char program[40] = {};
};
template <std::same_as<Hello> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(magic),       TAKT_FIELD(abi_version), TAKT_FIELD(role),        TAKT_FIELD(reserved),
      TAKT_FIELD(layout),      TAKT_FIELD(config_hash), TAKT_FIELD(policy_hash), TAKT_FIELD(joint_names_hash),
      TAKT_FIELD(joint_count), TAKT_FIELD(step_count),  TAKT_FIELD(program),
  };
}
static_assert(std::is_standard_layout_v<Hello> && sizeof(Hello) == 96);

enum class WelcomeStatus : std::uint8_t { accepted, refused };
struct Welcome {
  std::uint64_t magic = kMagic;
  WelcomeStatus status = WelcomeStatus::refused;
  std::uint8_t descriptor_count = 0;  // file descriptors that came along (SCM_RIGHTS)
  // Policies. 1: lockstep. Every observation waits for its answer, a chunk or one of 0 steps, which says that there is
  // none; all stamps are of the server's own time, and no clock has anything to do with them. 0: CLOCK_MONOTONIC.
  std::uint8_t lockstep = 0;
  std::uint8_t reserved[5] = {};
  char sentence[496] = {};  // why refused, or empty
};
template <std::same_as<Welcome> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(magic),    TAKT_FIELD(status),   TAKT_FIELD(descriptor_count),
      TAKT_FIELD(lockstep), TAKT_FIELD(reserved), TAKT_FIELD(sentence),
  };
}
static_assert(std::is_standard_layout_v<Welcome> && sizeof(Welcome) == 512);

// stop, press_stop, deenergise, swap and back mean what they mean as an OperatorRequest.
enum class OperatorVerb : std::uint8_t { status, arm, stop, reset, mark, press_stop, deenergise, swap, back };
inline constexpr std::size_t kOperatorVerbCount = 9;
struct OperatorMessage {
  std::uint64_t magic = kMagic;
  OperatorVerb verb = OperatorVerb::status;
  std::uint8_t reserved[7] = {};
  std::uint64_t policy_hash = 0;  // swap: of the policy that is to play
};
template <std::same_as<OperatorMessage> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(magic),
      TAKT_FIELD(verb),
      TAKT_FIELD(reserved),
      TAKT_FIELD(policy_hash),
  };
}
static_assert(std::is_standard_layout_v<OperatorMessage> && sizeof(OperatorMessage) == 24);

// What the monitor says after its hello, whenever more of the run has reached its medium. Tick 0: it records nothing.
struct RecorderWord {
  std::uint64_t magic = kMagic;
  std::uint64_t through_tick = 0;
};
template <std::same_as<RecorderWord> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(magic),
      TAKT_FIELD(through_tick),
  };
}
static_assert(std::is_standard_layout_v<RecorderWord> && sizeof(RecorderWord) == 16);

// The loop's state as the control thread last published it, plus what the service thread knows.
struct StatusSnapshot {
  TickRecordHeader tick;
  std::uint64_t ticks = 0;
  std::uint64_t overruns[kOverrunCauseCount] = {};
  std::uint64_t arrivals[kArrivalCount] = {};
  PerSeat<std::uint64_t> policy_pids{};  // 0: no policy attached
  std::uint64_t monitor_pid = 0;         // 0: no monitor attached
  std::uint8_t realtime = 0;             // 1 when the whole real-time set-up succeeded
  std::uint8_t recorder_required = 0;
  std::uint8_t drive_count = 0;     // joints that a drive can move
  std::uint8_t enabled_drives = 0;  // of these, told to be enabled: the others are told to have no power
  std::uint8_t reserved[4] = {};
};
template <std::same_as<StatusSnapshot> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(tick),        TAKT_FIELD(ticks),          TAKT_FIELD(overruns), TAKT_FIELD(arrivals),
      TAKT_FIELD(policy_pids), TAKT_FIELD(monitor_pid),    TAKT_FIELD(realtime), TAKT_FIELD(recorder_required),
      TAKT_FIELD(drive_count), TAKT_FIELD(enabled_drives), TAKT_FIELD(reserved),
  };
}

// The newest stop or fault since the executive started (incident/incident.hpp), for who has no tick records.
struct IncidentNote {
  std::uint64_t tick = 0;  // that entered it; 0: none yet
  MonoTime at;
  std::uint64_t first_tick = 0;  // of its chain
  std::uint32_t error_code = 0;  // the drive's own
  Mode mode = Mode::standby;     // entered
  Cause cause = Cause::none;
  std::uint8_t asked = 0;       // 1: a person wanted it
  std::uint8_t stands = 0;      // 1: the robot still stands in it
  char where[95] = {};          // "joint elbow"; empty: the robot as a whole
  std::uint8_t stop_asked = 0;  // 1: an operator asked for a stop then or since
  char sentence[1024] = {};     // cut off where it does not fit
};
template <std::same_as<IncidentNote> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(tick),  TAKT_FIELD(at),         TAKT_FIELD(first_tick), TAKT_FIELD(error_code),
      TAKT_FIELD(mode),  TAKT_FIELD(cause),      TAKT_FIELD(asked),      TAKT_FIELD(stands),
      TAKT_FIELD(where), TAKT_FIELD(stop_asked), TAKT_FIELD(sentence),
  };
}

struct OperatorReply {
  std::uint64_t magic = kMagic;
  std::uint8_t done = 0;  // 1: request carried out or under way
  std::uint8_t reserved[7] = {};
  StatusSnapshot status;
  IncidentNote incident;
  char sentences[2048] = {};  // one per line: why not, or what is missing
};
template <std::same_as<OperatorReply> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(magic),  TAKT_FIELD(done),     TAKT_FIELD(reserved),
      TAKT_FIELD(status), TAKT_FIELD(incident), TAKT_FIELD(sentences),
  };
}
static_assert(std::is_standard_layout_v<OperatorReply> && std::is_trivially_copyable_v<OperatorReply>);

}  // namespace takt
