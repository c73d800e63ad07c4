// SPDX-License-Identifier: Apache-2.0
// Where processes meet: a Unix SOCK_SEQPACKET socket on which a server hands out segments, one lease per role.
//
// Exchange: client sends Hello -> server checks magic, ABI, layout and SO_PEERCRED, then the lease table, then lets the
// owner decide -> Welcome with descriptors, or Welcome(refused) with a sentence ("policy is leased by pid 412
// (takt-policy-host) since 3 s: stop it first"). A lease ends when its connection closes. For the policy roles the
// client acknowledges (one byte) once it has mapped its mailbox; only then does the server seal and read it. It may say
// what keeps it from answering (PolicyWord), which the server passes on to the monitor. A monitor says again and again
// how far the run has reached its medium (RecorderWord).
// A policy that does not acknowledge within kGreetingTimeout loses the lease, so that it keeps no other policy out.
// Policy, fallback policy, candidate policy and monitor leases are exclusive. A sensor mailbox and the record rings may
// have several readers, and operator connections, which last for one request, may overlap. Nothing blocks: the server
// is driven by poll(); connects have a deadline. A client out of turn is disconnected. Thread rule: service
// threads only; a server and its handlers belong to one thread.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "executive/contract/operator_word.hpp"
#include "executive/contract/policy_word.hpp"
#include "executive/contract/session.hpp"
#include "executive/ipc/descriptor.hpp"

namespace takt::ipc {

// No client keeps an operator out, nor the one policy and the one monitor. Viewers and sensor readers stay: they are
// bounded: one more is refused with a sentence. So is the policy's user, with a few connections of its own. One that
// greets or asks, which takes an instant, gives way when too many do: of these the one that was quiet longest.
inline constexpr std::size_t kMaxReaders = 32, kMaxAsking = 16, kMaxPolicyConnections = 8;
// A client that connected must speak within this time, an operator must ask and a policy acknowledge within it.
inline constexpr std::chrono::milliseconds kGreetingTimeout{1000};
inline constexpr std::size_t kMaxDescriptors = 8;

struct Peer {
  Hello hello;    // claims; program is zero-terminated and printable
  pid_t pid = 0;  // SO_PEERCRED: what the kernel says, not what the peer claims
  uid_t uid = 0;
  bool confined = false;  // behind a policy's boundary: it has a policy's rights, whichever its user is
};

// What the server's owner answers to an admissible Hello.
struct Admission {
  std::string refusal;           // non-empty: refused with this sentence
  std::vector<int> descriptors;  // borrowed; duplicated into the peer
  bool lockstep = false;         // Welcome::lockstep
};

class RendezvousServer {
 public:
  // What was turned away since the start.
  struct Refusals {
    std::uint64_t malformed = 0;  // hello or message of a wrong size, magic, ABI, layout or role
    std::uint64_t silent = 0;     // connected or leased, but said nothing in time
    std::uint64_t unwelcome = 0;  // well-formed, but of another user, too many, role leased, or refused by the owner
  };
  // admit is mandatory; an absent other handler ignores its event. A handler may call holder() and evict().
  struct Handlers {
    std::function<Admission(const Peer&)> admit;                            // lease is free: may it have it?
    std::function<void(const Peer&)> acknowledged;                          // policy mapped its mailbox
    std::function<void(const Peer&, std::uint64_t through_tick)> recorded;  // the monitor's word
    std::function<void(const Peer&, const PolicyWord&)> said = {};          // a policy's: printable, with its role
    std::function<void(const Peer&)> left;                                  // lease over
    // Operator role only. `text`: printable, what a mark's user says of it; empty of other requests.
    std::function<OperatorReply(const Peer&, const OperatorMessage&, std::string_view text)> request;
  };
  // Creates the socket with mode 0660 (its directory made with mode 0750 if absent, a dead predecessor's socket
  // replaced, a live one refused with its sentence). `allowed_uid`: peers of any other uid but root are refused; when
  // it is not our own, socket and a directory made here are given to it. `policy_uid`: one more user, with those of
  // policy_users.hpp; they may be policies or read a sensor, and nothing else: not ask, so not arm.
  static std::expected<RendezvousServer, std::string> listen(const std::string& path, uid_t allowed_uid,
                                                             Handlers handlers, std::optional<uid_t> policy_uid = {});
  RendezvousServer(RendezvousServer&&) noexcept;
  RendezvousServer& operator=(RendezvousServer&&) noexcept;
  ~RendezvousServer();  // closes everything and unlinks the path

  // Handles whatever is ready, waiting at most `timeout` for it.
  void serve(std::chrono::milliseconds timeout);
  [[nodiscard]] const Peer* holder(Role role) const;  // nullptr: lease free; valid until the next serve() or evict()
  void evict(Role role);                              // closes the connection of every holder; `left` is called
  // To the monitor. False: there is none, or it has not read what it was told before.
  bool pass_on(const PolicyWord& word);
  bool pass_on(const OperatorWord& word);
  [[nodiscard]] Refusals refusals() const;
  // False: its socket, or the directory, was removed: who is not connected yet cannot connect any more.
  [[nodiscard]] bool has_name() const;

 private:
  class State;
  explicit RendezvousServer(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

// A client's lease: keep it alive for as long as the role is held.
struct Lease {
  Descriptor connection;
  std::vector<Descriptor> descriptors;
  bool lockstep = false;  // Welcome::lockstep
};

// Connects, says hello, waits at most `timeout`. The error is the server's sentence or what went wrong on the way.
// A layout of 0 in `hello` is filled in with contract_layout().
std::expected<Lease, std::string> attach(const std::string& path, const Hello& hello,
                                         std::chrono::milliseconds timeout);
std::expected<void, std::string> acknowledge(const Lease& lease);
// How far the run has reached the monitor's medium; tick 0: nothing is recorded any more. Never waits: a word that
// finds no room is lost, and the next one says more.
void tell_recorded(const Lease& lease, std::uint64_t through_tick);
// A policy's host of itself. Waits for nothing: a word that finds no room is lost. A longer sentence is cut off.
void tell(const Lease& lease, PolicyWordKind kind, std::string_view sentence, std::uint64_t first_sequence = 0);
// To a monitor: the next that was passed on; none: no further one yet.
std::optional<std::variant<PolicyWord, OperatorWord>> next_word(const Lease& lease);
// What a mark's user says of it follows its message.
inline constexpr std::size_t kLongestMark = 120;  // bytes
// True once the server closed the connection or died.
bool is_over(const Lease& lease);
// A stop takes its own way first (stop_line.hpp) and is under way before any process has to answer; the error says so.
// `policy_hash`: of a swap, the policy that is to play. `text`: of a mark; more than kLongestMark bytes are cut off.
std::expected<OperatorReply, std::string> ask(const std::string& path, OperatorVerb verb,
                                              std::chrono::milliseconds timeout, std::uint64_t policy_hash = 0,
                                              std::string_view text = {});

}  // namespace takt::ipc
