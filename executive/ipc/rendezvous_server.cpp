// SPDX-License-Identifier: Apache-2.0
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <list>
#include <optional>
#include <span>
#include <utility>

#include "executive/ipc/hello_check.hpp"
#include "executive/ipc/policy_users.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/socket_claim.hpp"
#include "executive/ipc/unix_socket.hpp"

namespace takt::ipc {
namespace {

using Clock = std::chrono::steady_clock;

constexpr bool is_exclusive(Role role) {
  return is_policy(role) || role == Role::monitor;
}

// Roles that several hold, each for as long as it likes.
constexpr bool is_reader(Role role) {
  return role == Role::sensor_reader || role == Role::viewer || is_input_reader(role);
}

// What the policy's own user may be.
constexpr bool is_for_policies(Role role) {
  return is_policy(role) || role == Role::sensor_reader;
}

// One of our user's that hides its namespace, or ends before it is looked at, has a reason to.
bool is_confined(const Credentials& peer, uid_t allowed_uid) {
  if (peer.pid <= 0) return false;
  switch (user_namespace_of(peer.pid)) {
    case UserNamespace::ours:
      return false;
    case UserNamespace::another:
      return true;
    case UserNamespace::unknown:
      return peer.uid == allowed_uid;
  }
  return true;
}

bool send_welcome(int socket, const Admission& admission) {
  Welcome welcome;
  welcome.status = admission.refusal.empty() ? WelcomeStatus::accepted : WelcomeStatus::refused;
  welcome.descriptor_count = static_cast<std::uint8_t>(admission.descriptors.size());
  welcome.lockstep = admission.lockstep ? 1 : 0;
  admission.refusal.copy(welcome.sentence, sizeof welcome.sentence - 1);
  return send_message(socket, std::as_bytes(std::span(&welcome, 1)), admission.descriptors);
}

// A Unix socket that is closed with unread messages makes the peer's next read fail, although our refusal is waiting
// for it there. Stop the peer from sending, take what it sent, then close.
void close_politely(Descriptor& socket) {
  shutdown(socket.get(), SHUT_RD);
  std::byte ignored{};
  while (recv(socket.get(), &ignored, sizeof ignored, MSG_DONTWAIT) > 0) {
  }
  socket.close();
}

}  // namespace

class RendezvousServer::State {
 public:
  State(SocketClaim claim, uid_t allowed_uid, std::optional<uid_t> policy_uid, Handlers handlers)
      : claim_(std::move(claim)),
        allowed_uid_(allowed_uid),
        policy_users_(PolicyUsers::around(policy_uid)),
        handlers_(std::move(handlers)) {}
  ~State();
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  void serve(std::chrono::milliseconds timeout);
  const Peer* holder(Role role) const;
  void evict(Role role);
  bool tell_monitor(std::span<const std::byte> word) const;
  Refusals refusals() const { return refusals_; }
  bool has_name() const { return claim_.has_name(); }

 private:
  enum class Stage : std::uint8_t { greeting, leased, closed };
  struct Connection {
    Descriptor socket;
    Peer peer;
    Stage stage = Stage::greeting;
    bool has_spoken = false;  // since the lease began: acknowledged, or asked
    Clock::time_point since;  // of this stage
  };

  int wait_time(std::chrono::milliseconds timeout) const;
  bool is_ours(const Peer& peer) const { return (peer.uid == allowed_uid_ || peer.uid == 0) && !peer.confined; }
  bool is_confined_self(const Peer& peer) const { return peer.confined && (peer.uid == allowed_uid_ || peer.uid == 0); }
  bool may_be_policy(const Peer& peer) const { return policy_users_.include(peer.uid) || is_confined_self(peer); }
  bool has_seat(const Peer& peer, Role role) const {
    return is_for_policies(role) && (is_confined_self(peer) || policy_users_.may_be(peer.uid, role));
  }
  std::ptrdiff_t connections_like(const Peer& peer) const;
  static bool must_speak(const Connection& connection);
  void accept_newcomer();
  void make_room(const Connection& newcomer);
  void hear(Connection& connection);
  void greet(Connection& connection, Hello hello, ssize_t size);
  std::string lease_conflict(Role role) const;
  bool has_room_for(Role role) const;
  void answer(Connection& connection, std::span<std::byte> bytes, ssize_t size);
  void hear_policy(Connection& connection, PolicyWord word, ssize_t size);
  void take_word(Connection& connection, const RecorderWord& word, ssize_t size);
  void refuse(Connection& connection, std::uint64_t& counter, const std::string& sentence);
  void drop(Connection& connection);
  void drop_silent();

  SocketClaim claim_;
  uid_t allowed_uid_;
  PolicyUsers policy_users_;
  Handlers handlers_;
  Refusals refusals_;
  std::list<Connection> connections_;  // a list: holder() hands out addresses
};

RendezvousServer::State::~State() {
  for (Connection& connection : connections_) {
    if (connection.stage != Stage::closed) close_politely(connection.socket);
  }
}

bool RendezvousServer::State::must_speak(const Connection& connection) {
  switch (connection.stage) {
    case Stage::greeting:
      return true;
    case Stage::closed:
      return false;
    case Stage::leased:
      break;
  }
  const Role role = connection.peer.hello.role;
  return role == Role::operator_console || (is_policy(role) && !connection.has_spoken);
}

int RendezvousServer::State::wait_time(std::chrono::milliseconds timeout) const {
  const Clock::time_point now = Clock::now();
  for (const Connection& connection : connections_) {
    if (!must_speak(connection)) continue;
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(connection.since + kGreetingTimeout - now);
    timeout = std::clamp(left, std::chrono::milliseconds(0), timeout);
  }
  return static_cast<int>(timeout.count());
}

void RendezvousServer::State::serve(std::chrono::milliseconds timeout) {
  connections_.remove_if([](const Connection& connection) { return connection.stage == Stage::closed; });
  std::vector<pollfd> polled{{claim_.listener(), POLLIN, 0}};
  std::vector<Connection*> polled_connections;
  for (Connection& connection : connections_) {
    polled.push_back({connection.socket.get(), POLLIN, 0});
    polled_connections.push_back(&connection);
  }
  const bool any_ready = poll(polled.data(), polled.size(), wait_time(timeout)) > 0;
  const auto is_ready = [&](std::size_t i, int events) {
    return any_ready && (polled[i + 1].revents & events) != 0 && polled_connections[i]->stage != Stage::closed;
  };
  // Departures first, so that a lease is free again for a client that comes right after its holder.
  for (std::size_t i = 0; i < polled_connections.size(); ++i) {
    if (is_ready(i, POLLHUP | POLLERR)) drop(*polled_connections[i]);
  }
  for (std::size_t i = 0; i < polled_connections.size(); ++i) {
    if (is_ready(i, POLLIN)) hear(*polled_connections[i]);
  }
  if (any_ready && polled.front().revents != 0) accept_newcomer();
  drop_silent();
}

// One per round: a client that hung up before this newcomer connected has been noticed, and gave room.
void RendezvousServer::State::accept_newcomer() {
  Descriptor socket(accept4(claim_.listener(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (!socket.is_open()) return;
  const Credentials credentials = peer_of(socket.get());
  Connection& connection = connections_.emplace_back();
  connection.socket = std::move(socket);
  connection.peer.pid = credentials.pid;
  connection.peer.uid = credentials.uid;
  connection.peer.confined = is_confined(credentials, allowed_uid_);
  connection.since = Clock::now();
  if (is_ours(connection.peer)) return make_room(connection);
  if (connections_like(connection.peer) > static_cast<std::ptrdiff_t>(kMaxPolicyConnections)) {
    refuse(connection, refusals_.unwelcome,
           "the policy's user holds " + std::to_string(kMaxPolicyConnections) +
               " connections already: close some, then try again");
  }
}

// Each policy's user has its own; those who may not connect share theirs until they are told.
std::ptrdiff_t RendezvousServer::State::connections_like(const Peer& peer) const {
  return std::ranges::count_if(connections_, [&](const Connection& each) {
    const bool alike = may_be_policy(peer) ? each.peer.uid == peer.uid : !may_be_policy(each.peer);
    return each.stage != Stage::closed && !is_ours(each.peer) && alike;
  });
}

// An operator who connected speaks at once: the one that is quiet longest is none in need.
void RendezvousServer::State::make_room(const Connection& newcomer) {
  std::size_t asking = 0;
  Connection* quietest = nullptr;
  for (Connection& each : connections_) {
    if (!must_speak(each) || !is_ours(each.peer)) continue;
    ++asking;
    if (&each != &newcomer && (quietest == nullptr || each.since < quietest->since)) quietest = &each;
  }
  if (asking > kMaxAsking && quietest != nullptr)
    refuse(*quietest, refusals_.silent, "too many ask at once, and this one was quiet longest: try again");
}

void RendezvousServer::State::hear(Connection& connection) {
  // Room for one byte more than the largest message expected: a longer one shows by its size.
  union {
    Hello hello;
    RecorderWord word;
    PolicyWord policy_word;
    std::byte bytes[sizeof(PolicyWord) + 1];
  } message{};
  const ssize_t size = recv(connection.socket.get(), message.bytes, sizeof message.bytes, MSG_DONTWAIT | MSG_TRUNC);
  if (size < 0) return;  // nothing after all; a broken connection hangs up at the next poll
  if (size == 0) return drop(connection);
  if (connection.stage == Stage::greeting) return greet(connection, message.hello, size);
  const Role role = connection.peer.hello.role;
  if (role == Role::operator_console) return answer(connection, message.bytes, size);
  if (is_policy(role)) return hear_policy(connection, message.policy_word, size);
  if (role == Role::monitor) return take_word(connection, message.word, size);
  refuse(connection, refusals_.malformed, "this role has nothing to say after its hello");
}

void RendezvousServer::State::greet(Connection& connection, Hello hello, ssize_t size) {
  const uid_t uid = connection.peer.uid;
  const bool ours = is_ours(connection.peer);
  if (!ours && !may_be_policy(connection.peer)) {
    return refuse(
        connection, refusals_.unwelcome,
        "user " + std::to_string(uid) + " may not connect: run as user " + std::to_string(allowed_uid_) + " or root");
  }
  if (const std::string fault = fault_in(hello, size); !fault.empty()) {
    return refuse(connection, refusals_.malformed, fault);
  }
  if (!ours && !has_seat(connection.peer, hello.role)) {
    const std::string user = "user " + std::to_string(uid);
    const std::string who = is_for_policies(hello.role) ? user + " is another policy's"
                            : connection.peer.confined  ? "pid " + std::to_string(connection.peer.pid) +
                                                             " runs in another user namespace, as a policy does,"
                                                       : user + " is the policy's";
    return refuse(connection, refusals_.unwelcome,
                  who + " and may not be " + std::string(name(hello.role)) + ": run as user " +
                      std::to_string(allowed_uid_) + " or root");
  }
  make_printable(hello.program);
  if (ours && !has_room_for(hello.role)) {
    return refuse(
        connection, refusals_.unwelcome,
        std::to_string(kMaxReaders) + " viewers and readers are attached already: close some, then try again");
  }
  if (const std::string conflict = lease_conflict(hello.role); !conflict.empty()) {
    return refuse(connection, refusals_.unwelcome, conflict);
  }
  connection.peer.hello = hello;
  const Admission admission = handlers_.admit(connection.peer);
  if (!admission.refusal.empty()) return refuse(connection, refusals_.unwelcome, admission.refusal);
  connection.stage = Stage::leased;
  connection.since = Clock::now();
  if (!send_welcome(connection.socket.get(), admission)) drop(connection);
}

bool RendezvousServer::State::has_room_for(Role role) const {
  const auto readers = std::ranges::count_if(connections_, [this](const Connection& each) {
    return each.stage == Stage::leased && is_ours(each.peer) && is_reader(each.peer.hello.role);
  });
  return !is_reader(role) || static_cast<std::size_t>(readers) < kMaxReaders;
}

std::string RendezvousServer::State::lease_conflict(Role role) const {
  const Peer* const other = holder(role);
  if (other == nullptr || !is_exclusive(role)) return {};
  const std::string pid = std::to_string(other->pid);
  return std::string(name(role)) + " is leased by pid " + pid + " (" + other->hello.program +
         "): stop it first (kill " + pid + ") or wait until it ends";
}

void RendezvousServer::State::hear_policy(Connection& connection, PolicyWord word, ssize_t size) {
  if (size == 1 && !connection.has_spoken) {
    connection.has_spoken = true;
    if (handlers_.acknowledged) handlers_.acknowledged(connection.peer);
    return;
  }
  const std::string fault = fault_in(word, size);
  if (!fault.empty() || !connection.has_spoken) {
    return refuse(connection, refusals_.malformed, fault.empty() ? "a policy acknowledges before it speaks" : fault);
  }
  make_printable(word.sentence);
  word.role = connection.peer.hello.role;
  word.superseded = 0;
  if (handlers_.said) handlers_.said(connection.peer, word);
}

bool RendezvousServer::State::tell_monitor(std::span<const std::byte> word) const {
  const auto monitor = std::ranges::find_if(connections_, [](const Connection& each) {
    return each.stage == Stage::leased && each.peer.hello.role == Role::monitor;
  });
  return monitor != connections_.end() && send_message(monitor->socket.get(), word, {});
}

void RendezvousServer::State::take_word(Connection& connection, const RecorderWord& word, ssize_t size) {
  if (size != sizeof word || word.magic != kMagic)
    return refuse(connection, refusals_.malformed, "not a recorder's word: how far the run is recorded");
  if (handlers_.recorded) handlers_.recorded(connection.peer, word.through_tick);
}

// Precondition: `bytes` holds the longest request, and `size` of it came, or would have.
void RendezvousServer::State::answer(Connection& connection, std::span<std::byte> bytes, ssize_t size) {
  OperatorMessage message;
  std::memcpy(&message, bytes.data(), sizeof message);
  const auto text_bytes = static_cast<std::size_t>(size) - sizeof message;  // far too many where some lack
  const std::size_t most_text = message.verb == OperatorVerb::mark ? kLongestMark : 0;
  const bool is_known =
      text_bytes <= most_text && message.magic == kMagic && static_cast<std::size_t>(message.verb) < kOperatorVerbCount;
  if (!is_known || !handlers_.request) return refuse(connection, refusals_.malformed, "not an operator's request");
  connection.has_spoken = true;
  connection.since = Clock::now();
  std::array<char, kLongestMark + 1> text{};
  std::memcpy(text.data(), bytes.data() + sizeof message, text_bytes);
  make_printable(text);
  const OperatorReply reply = handlers_.request(connection.peer, message, text.data());
  if (!send_message(connection.socket.get(), std::as_bytes(std::span(&reply, 1)), {})) drop(connection);
}

void RendezvousServer::State::refuse(Connection& connection, std::uint64_t& counter, const std::string& sentence) {
  ++counter;
  if (connection.stage != Stage::closed) send_welcome(connection.socket.get(), {sentence, {}});
  drop(connection);
}

void RendezvousServer::State::drop(Connection& connection) {
  if (connection.stage == Stage::closed) return;
  const bool was_leased = std::exchange(connection.stage, Stage::closed) == Stage::leased;
  close_politely(connection.socket);
  if (was_leased && handlers_.left) handlers_.left(connection.peer);
}

void RendezvousServer::State::drop_silent() {
  const Clock::time_point now = Clock::now();
  for (Connection& connection : connections_) {
    if (!must_speak(connection) || now < connection.since + kGreetingTimeout) continue;
    if (!connection.has_spoken) ++refusals_.silent;
    drop(connection);
  }
}

const Peer* RendezvousServer::State::holder(Role role) const {
  const auto found = std::ranges::find_if(connections_, [role](const Connection& connection) {
    return connection.stage == Stage::leased && connection.peer.hello.role == role;
  });
  return found == connections_.end() ? nullptr : &found->peer;
}

void RendezvousServer::State::evict(Role role) {
  for (Connection& connection : connections_) {
    if (connection.stage == Stage::leased && connection.peer.hello.role == role) drop(connection);
  }
}

std::expected<RendezvousServer, std::string> RendezvousServer::listen(const std::string& path, uid_t allowed_uid,
                                                                      Handlers handlers,
                                                                      std::optional<uid_t> policy_uid) {
  if (!handlers.admit) return std::unexpected("rendezvous: no admit handler: fix the caller");
  auto claim = SocketClaim::make(path, allowed_uid);
  if (!claim) return std::unexpected(claim.error());
  return RendezvousServer(std::make_unique<State>(std::move(*claim), allowed_uid, policy_uid, std::move(handlers)));
}

RendezvousServer::RendezvousServer(std::unique_ptr<State> state) : state_(std::move(state)) {}
RendezvousServer::RendezvousServer(RendezvousServer&&) noexcept = default;
RendezvousServer& RendezvousServer::operator=(RendezvousServer&&) noexcept = default;
RendezvousServer::~RendezvousServer() = default;

void RendezvousServer::serve(std::chrono::milliseconds timeout) {
  state_->serve(timeout);
}
const Peer* RendezvousServer::holder(Role role) const {
  return state_->holder(role);
}
void RendezvousServer::evict(Role role) {
  state_->evict(role);
}
bool RendezvousServer::pass_on(const PolicyWord& word) {
  return state_->tell_monitor(std::as_bytes(std::span(&word, 1)));
}
bool RendezvousServer::pass_on(const OperatorWord& word) {
  return state_->tell_monitor(std::as_bytes(std::span(&word, 1)));
}
bool RendezvousServer::has_name() const {
  return state_->has_name();
}
RendezvousServer::Refusals RendezvousServer::refusals() const {
  return state_->refusals();
}

}  // namespace takt::ipc
