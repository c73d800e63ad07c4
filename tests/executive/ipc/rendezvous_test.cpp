// SPDX-License-Identifier: Apache-2.0
// Goal: one lease per role, refusals that tell a person what to do, and a server that no client can hold up. Method: a
// served socket in a temporary directory, real clients through the public functions, rude ones through raw sockets.
#include "executive/ipc/rendezvous.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <mutex>
#include <random>

#include "executive/contract/contract_layout.hpp"
#include "executive/ipc/policy_users.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "tests/executive/ipc/rendezvous_server_thread.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::ipc {
namespace {

constexpr std::chrono::milliseconds kTimeout{5000};
using Handlers = RendezvousServer::Handlers;

Hello hello_of(Role role, const char* program = "takt-test") {
  Hello hello;
  hello.role = role;
  hello.layout = contract_layout();
  std::strncpy(hello.program, program, sizeof hello.program - 1);
  return hello;
}

Handlers admit_all() {
  return {
      .admit = [](const Peer&) { return Admission{}; }, .acknowledged = {}, .recorded = {}, .left = {}, .request = {}};
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// Connects without saying anything.
Descriptor raw_client(const std::string& path) {
  Descriptor socket = open_seqpacket();
  EXPECT_TRUE(connect_to(socket, path)) << std::strerror(errno);
  return socket;
}

void say(const Descriptor& socket, const void* what, std::size_t bytes) {
  EXPECT_TRUE(send_message(socket.get(), std::span(static_cast<const std::byte*>(what), bytes), {}));
}

// What the server answered to a raw client before it hung up.
struct Answer {
  WelcomeStatus status = WelcomeStatus::accepted;
  std::string sentence;
  bool hung_up = false;
};
Answer answer_to(const Descriptor& socket) {
  Welcome welcome;
  EXPECT_EQ(recv(socket.get(), &welcome, sizeof welcome, 0), static_cast<ssize_t>(sizeof welcome));
  std::byte next{};
  return {welcome.status, welcome.sentence, recv(socket.get(), &next, 1, 0) <= 0};
}

constexpr uid_t kPolicyUser = 65534;

class Rendezvous : public testing::Test {
 protected:
  void let_everybody_in() {
    std::filesystem::permissions(path_, std::filesystem::perms::all);
    for (const char* open : {"", "/run", "/run/arm"})
      std::filesystem::permissions(directory_.path(open), std::filesystem::perms::all);
  }

  test::TemporaryDirectory directory_;
  std::string path_ = directory_.path("run/arm/executive.sock");
};

TEST_F(Rendezvous, MakesItsDirectoryAndCleansUp) {
  {
    const ServerThread server(path_, admit_all());
    struct stat status {};
    ASSERT_EQ(stat(directory_.path("run/arm").c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, 0750U);
    ASSERT_EQ(lstat(path_.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, 0660U);
  }
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(Rendezvous, ReplacesADeadServersSocketButRespectsALiveOne) {
  std::filesystem::create_directories(directory_.path("run/arm"));
  { const auto dead = listen_at(path_); }  // closed without unlinking, as a killed process leaves it
  ASSERT_TRUE(std::filesystem::exists(path_));
  const ServerThread server(path_, admit_all());
  const auto second = RendezvousServer::listen(path_, geteuid(), admit_all());
  ASSERT_FALSE(second);
  EXPECT_TRUE(contains(second.error(), "another server is live at " + path_)) << second.error();
  EXPECT_TRUE(attach(path_, hello_of(Role::policy), kTimeout)) << "the first server was disturbed";
}

// Goal: who may open the directory keeps no server from starting. Method: the directory is locked, as a process of
// the policy's group could do it for ever; the lock in use is its owner's alone.
// Threat: user-locks-robot
TEST_F(Rendezvous, ALockOnTheDirectoryKeepsNoServerFromStarting) {
  std::filesystem::create_directories(directory_.path("run/arm"));
  const Descriptor held(open(directory_.path("run/arm").c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  ASSERT_EQ(flock(held.get(), LOCK_EX | LOCK_NB), 0);
  const ServerThread server(path_, admit_all());
  EXPECT_TRUE(attach(path_, hello_of(Role::policy), kTimeout));
  struct stat status {};
  ASSERT_EQ(lstat(directory_.path("run/arm/.lock").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600U);
}

// A server that root started leaves the directory's owner a lock that it can open.
TEST_F(Rendezvous, TheLockIsTheDirectorysOwners) {
  if (geteuid() != 0) GTEST_SKIP() << "NOT TESTED: only root gives files away";
  std::filesystem::create_directories(directory_.path("run/arm"));
  ASSERT_EQ(chown(directory_.path("run/arm").c_str(), kPolicyUser, kPolicyUser), 0);
  { const ServerThread server(path_, admit_all()); }
  struct stat status {};
  ASSERT_EQ(lstat(directory_.path("run/arm/.lock").c_str(), &status), 0);
  EXPECT_EQ(status.st_uid, kPolicyUser);
}

TEST_F(Rendezvous, LeavesForeignFilesAndSuccessorsAlone) {
  std::filesystem::create_directories(path_);
  EXPECT_FALSE(RendezvousServer::listen(path_, geteuid(), admit_all()));
  EXPECT_TRUE(std::filesystem::is_directory(path_));
  std::filesystem::remove(path_);
  {
    const ServerThread server(path_, admit_all());
    std::filesystem::remove(path_);
    std::filesystem::create_directory(path_);
  }
  EXPECT_TRUE(std::filesystem::exists(path_)) << "removed what was not its own";
}

TEST_F(Rendezvous, TooLongPathIsRefusedWithItsLength) {
  const auto server = RendezvousServer::listen(directory_.path(std::string(120, 'x')), geteuid(), admit_all());
  ASSERT_FALSE(server);
  EXPECT_TRUE(contains(server.error(), "--runtime-dir")) << server.error();
}

TEST_F(Rendezvous, HandsOutDescriptorsAndHearsTheAcknowledgement) {
  auto segment = Segment::create("takt-test", 4096, true);
  ASSERT_TRUE(segment);
  segment->writable()[5] = std::byte{55};
  std::atomic<pid_t> acknowledged_by = 0;
  Handlers handlers = admit_all();
  handlers.admit = [&](const Peer& peer) {
    EXPECT_EQ(peer.pid, getpid());
    EXPECT_EQ(peer.uid, geteuid());
    EXPECT_STREQ(peer.hello.program, "takt-policy-host");
    return Admission{{}, {segment->fd(), segment->fd()}};
  };
  handlers.acknowledged = [&](const Peer& peer) { acknowledged_by = peer.pid; };
  ServerThread server(path_, handlers);
  auto lease = attach(path_, hello_of(Role::policy, "takt-policy-host"), kTimeout);
  ASSERT_TRUE(lease) << lease.error();
  ASSERT_EQ(lease->descriptors.size(), 2U);
  auto theirs = Segment::adopt_read_only(lease->descriptors[1].release(), 4096);
  ASSERT_TRUE(theirs) << theirs.error();
  EXPECT_EQ(theirs->readable()[5], std::byte{55});
  ASSERT_TRUE(acknowledge(*lease));
  while (acknowledged_by == 0) std::this_thread::yield();
  EXPECT_EQ(acknowledged_by, getpid());
  EXPECT_FALSE(is_over(*lease));
}

TEST_F(Rendezvous, SecondHolderIsToldWhoHoldsTheLeaseAndHowToMend) {
  const ServerThread server(path_, admit_all());
  for (const Role role : {Role::policy, Role::fallback_policy, Role::candidate_policy, Role::monitor}) {
    const auto first = attach(path_, hello_of(role, "first-holder"), kTimeout);
    ASSERT_TRUE(first) << first.error();
    const auto second = attach(path_, hello_of(role, "second"), kTimeout);
    ASSERT_FALSE(second);
    const std::string pid = std::to_string(getpid());
    EXPECT_TRUE(contains(second.error(), std::string(name(role)) + " is leased by pid " + pid + " (first-holder)"))
        << second.error();
    EXPECT_TRUE(contains(second.error(), "stop it first (kill " + pid + ")")) << second.error();
    EXPECT_FALSE(is_over(*first));
  }
}

TEST_F(Rendezvous, LeaseIsFreeOnceItsConnectionCloses) {
  std::atomic<int> departures = 0;
  Handlers handlers = admit_all();
  handlers.left = [&](const Peer&) { ++departures; };
  ServerThread server(path_, handlers);
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(attach(path_, hello_of(Role::policy), kTimeout)) << "round " << i;
  }
  EXPECT_GE(departures, 19);
}

TEST_F(Rendezvous, SensorsAndRecordsHaveSeveralReaders) {
  const ServerThread server(path_, admit_all());
  for (const Role role : {Role::sensor_reader, Role::viewer}) {
    const auto first = attach(path_, hello_of(role), kTimeout);
    const auto second = attach(path_, hello_of(role), kTimeout);
    EXPECT_TRUE(first && second) << name(role);
  }
}

TEST_F(Rendezvous, OwnersRefusalReachesTheClient) {
  Handlers handlers = admit_all();
  handlers.admit = [](const Peer& peer) {
    return Admission{"policy expects " + std::to_string(peer.hello.joint_count) + " joints", {}};
  };
  ServerThread server(path_, handlers);
  Hello hello = hello_of(Role::policy);
  hello.joint_count = 12;
  const auto lease = attach(path_, hello, kTimeout);
  ASSERT_FALSE(lease);
  EXPECT_EQ(lease.error(), "policy expects 12 joints");
  EXPECT_EQ(server.stopped().refusals().unwelcome, 1U);
  EXPECT_EQ(server.stopped().holder(Role::policy), nullptr);
}

// Threat: user-talks
TEST_F(Rendezvous, MalformedHellosAreRefusedWithASentenceAndCounted) {
  ServerThread server(path_, admit_all());
  const auto refused = [&](const void* what, std::size_t bytes, const char* because) {
    const Descriptor client = raw_client(path_);
    say(client, what, bytes);
    const Answer answer = answer_to(client);
    EXPECT_EQ(answer.status, WelcomeStatus::refused);
    EXPECT_TRUE(contains(answer.sentence, because)) << answer.sentence;
    EXPECT_TRUE(answer.hung_up);
  };
  const auto refused_hello = [&](auto change, const char* because) {
    Hello hello = hello_of(Role::policy);
    change(hello);
    refused(&hello, sizeof hello, because);
  };
  refused_hello([](Hello& hello) { hello.magic ^= 1; }, "magic");
  refused_hello([](Hello& hello) { hello.abi_version = 99; }, "client has ABI version 99");
  refused_hello([](Hello& hello) { hello.layout ^= 1; }, "layout");
  refused_hello([](Hello& hello) { hello.role = static_cast<Role>(99); }, "role 99");
  refused_hello([](Hello& hello) { hello.reserved[1] = 1; }, "reserved");
  const Hello whole = hello_of(Role::policy);
  refused(&whole, sizeof whole - 1, "95 bytes");
  refused(&whole, 1, "1 bytes");
  std::vector<char> longer(3000, 'x');
  refused(longer.data(), longer.size(), "3000 bytes");
  std::mt19937 random(3);
  for (char& c : longer) c = static_cast<char>(random());
  refused(longer.data(), sizeof whole, "magic");
  EXPECT_EQ(server.stopped().refusals().malformed, 9U);
}

TEST_F(Rendezvous, ProgramNamesArePrintable) {
  std::mutex mutex;
  std::string seen;
  Handlers handlers = admit_all();
  handlers.admit = [&](const Peer& peer) {
    const std::lock_guard lock(mutex);
    seen = peer.hello.program;
    return Admission{};
  };
  const ServerThread server(path_, handlers);
  Hello hello = hello_of(Role::monitor);
  std::memset(hello.program, 'a', sizeof hello.program);
  hello.program[0] = '\n';
  hello.program[1] = '\x1b';
  ASSERT_TRUE(attach(path_, hello, kTimeout));
  const std::lock_guard lock(mutex);
  EXPECT_EQ(seen, "??" + std::string(sizeof hello.program - 3, 'a'));
}

TEST_F(Rendezvous, SilentClientsAreDroppedAndCounted) {
  ServerThread server(path_, admit_all());
  const Descriptor silent = raw_client(path_);
  std::byte byte{};
  EXPECT_LE(recv(silent.get(), &byte, 1, 0), 0) << "waits for the hang-up";
  EXPECT_EQ(server.stopped().refusals().silent, 1U);
}

// Goal: who takes the policy's lease and never acknowledges keeps it for a moment, not for ever; one that did keeps
// it although it says nothing more. Method: one silent client, whose hang-up is waited for, then another's lease.
TEST_F(Rendezvous, APolicyThatNeverAcknowledgesLosesItsLease) {
  std::atomic<int> left = 0;
  Handlers handlers = admit_all();
  handlers.left = [&](const Peer&) { ++left; };
  ServerThread server(path_, handlers);
  const auto silent = attach(path_, hello_of(Role::policy), kTimeout);
  ASSERT_TRUE(silent) << silent.error();
  EXPECT_FALSE(attach(path_, hello_of(Role::policy), kTimeout)) << "leased for now";
  std::byte byte{};
  EXPECT_LE(recv(silent->connection.get(), &byte, 1, 0), 0) << "waits for the hang-up";
  const auto next = attach(path_, hello_of(Role::policy), kTimeout);
  ASSERT_TRUE(next) << next.error();
  ASSERT_TRUE(acknowledge(*next));
  const auto monitor = attach(path_, hello_of(Role::monitor), kTimeout);
  ASSERT_TRUE(monitor) << monitor.error();
  const Descriptor later = raw_client(path_);  // its deadline comes after that of `next`
  EXPECT_LE(recv(later.get(), &byte, 1, 0), 0) << "waits for the hang-up";
  EXPECT_FALSE(is_over(*next));
  EXPECT_FALSE(is_over(*monitor)) << "has nothing to say";
  EXPECT_EQ(left, 1);
  EXPECT_EQ(server.stopped().refusals().silent, 2U);
}

TEST_F(Rendezvous, SpeakingOutOfTurnEndsTheLease) {
  std::atomic<int> acknowledgements = 0;
  Handlers handlers = admit_all();
  handlers.acknowledged = [&](const Peer&) { ++acknowledgements; };
  ServerThread server(path_, handlers);
  for (const Role role : {Role::policy, Role::monitor, Role::sensor_reader, Role::viewer}) {
    const auto lease = attach(path_, hello_of(role), kTimeout);
    ASSERT_TRUE(lease) << lease.error();
    const char chatter[] = "hello again";
    say(lease->connection, chatter, sizeof chatter);
    EXPECT_TRUE(answer_to(lease->connection).hung_up);
    EXPECT_TRUE(is_over(*lease));
  }
  const auto twice = attach(path_, hello_of(Role::policy), kTimeout);
  ASSERT_TRUE(acknowledge(*twice));
  acknowledge(*twice);  // may find the connection closed already
  EXPECT_EQ(answer_to(twice->connection).status, WelcomeStatus::refused);
  EXPECT_EQ(server.stopped().refusals().malformed, 5U);
  EXPECT_EQ(acknowledgements, 1);
}

TEST_F(Rendezvous, AMonitorSaysHowFarItHasRecorded) {
  std::atomic<std::uint64_t> through = 0;
  Handlers handlers = admit_all();
  handlers.recorded = [&](const Peer&, std::uint64_t tick) { through = tick; };
  ServerThread server(path_, handlers);
  const auto monitor = attach(path_, hello_of(Role::monitor), kTimeout);
  ASSERT_TRUE(monitor) << monitor.error();
  for (const std::uint64_t tick : {41U, 42U}) {
    tell_recorded(*monitor, tick);
    while (through != tick && !is_over(*monitor)) std::this_thread::yield();
    EXPECT_EQ(through, tick);
  }
  RecorderWord strange;
  strange.magic = 0;
  say(monitor->connection, &strange, sizeof strange);
  EXPECT_EQ(answer_to(monitor->connection).status, WelcomeStatus::refused);
  EXPECT_EQ(server.stopped().refusals().malformed, 1U);
}

// Goal: what a policy says of itself comes to the owner printable and with the policy's own role, and to the monitor;
// what is no such word, or comes before its mailbox is mapped, ends the lease.
TEST_F(Rendezvous, APolicySaysWhatKeepsItFromAnswering) {
  std::mutex mutex;
  std::vector<PolicyWord> said;
  Handlers handlers = admit_all();
  handlers.said = [&](const Peer&, const PolicyWord& word) {
    const std::lock_guard lock(mutex);
    said.push_back(word);
  };
  ServerThread server(path_, handlers);
  const auto policy = attach(path_, hello_of(Role::fallback_policy), kTimeout);
  ASSERT_TRUE(policy) << policy.error();
  ASSERT_TRUE(acknowledge(*policy));
  tell(*policy, PolicyWordKind::source, "server \x1b[31mfar\n", 17);
  tell(*policy, PolicyWordKind::problem, std::string(5000, 'x'));
  const auto count = [&] {
    const std::lock_guard lock(mutex);
    return said.size();
  };
  while (count() < 2 && !is_over(*policy)) std::this_thread::yield();
  ASSERT_EQ(count(), 2U);
  EXPECT_EQ(said[0].kind, PolicyWordKind::source);
  EXPECT_EQ(said[0].role, Role::fallback_policy);
  EXPECT_EQ(said[0].first_sequence, 17U);
  EXPECT_STREQ(said[0].sentence, "server ?[31mfar?");
  EXPECT_EQ(std::string(said[1].sentence), std::string(199, 'x'));
  PolicyWord strange;
  strange.kind = static_cast<PolicyWordKind>(7);
  say(policy->connection, &strange, sizeof strange);
  EXPECT_EQ(answer_to(policy->connection).status, WelcomeStatus::refused);
  const auto early = attach(path_, hello_of(Role::policy), kTimeout);
  ASSERT_TRUE(early) << early.error();
  tell(*early, PolicyWordKind::problem, "before its mailbox is mapped");
  EXPECT_EQ(answer_to(early->connection).status, WelcomeStatus::refused);
  EXPECT_EQ(count(), 2U);
  EXPECT_EQ(server.stopped().refusals().malformed, 2U);
}

// As many viewers as there may be: one more is told so, and clients that matter more still get in.
// Threat: user-crowds
TEST_F(Rendezvous, ViewersAreBoundedAndKeepNobodyElseOut) {
  Handlers handlers = admit_all();
  handlers.request = [](const Peer&, const OperatorMessage&, std::string_view) { return OperatorReply{}; };
  const ServerThread server(path_, handlers);
  std::vector<Lease> leases;
  for (std::size_t i = 0; i < kMaxReaders; ++i) {
    auto lease = attach(path_, hello_of(i % 2 == 0 ? Role::viewer : Role::sensor_reader), kTimeout);
    ASSERT_TRUE(lease) << i << ": " << lease.error();
    leases.push_back(std::move(*lease));
  }
  const auto one_more = attach(path_, hello_of(Role::viewer), kTimeout);
  ASSERT_FALSE(one_more);
  EXPECT_TRUE(contains(one_more.error(), "32 viewers")) << one_more.error();
  const auto stopped = ask(path_, OperatorVerb::stop, kTimeout);
  EXPECT_TRUE(stopped) << stopped.error();
  const auto monitor = attach(path_, hello_of(Role::monitor), kTimeout);
  EXPECT_TRUE(monitor) << monitor.error();
  const auto policy = attach(path_, hello_of(Role::policy), kTimeout);
  EXPECT_TRUE(policy) << policy.error();
  leases.pop_back();
  // The departed is noticed before the newcomer is heard.
  EXPECT_TRUE(attach(path_, hello_of(Role::viewer), kTimeout));
}

// Connections that say nothing, and operators that asked once and stay: never longer than until a client asks.
TEST_F(Rendezvous, WhoeverIsQuietGivesWayToAnOperator) {
  Handlers handlers = admit_all();
  handlers.request = [](const Peer&, const OperatorMessage&, std::string_view) { return OperatorReply{}; };
  ServerThread server(path_, handlers);
  std::vector<Descriptor> silent;
  std::vector<Lease> operators;
  for (std::size_t i = 0; i < 2 * kMaxAsking; ++i) {
    silent.push_back(raw_client(path_));
    auto lease = attach(path_, hello_of(Role::operator_console), kTimeout);
    ASSERT_TRUE(lease) << i << ": " << lease.error();
    operators.push_back(std::move(*lease));
    const auto stopped = ask(path_, OperatorVerb::stop, kTimeout);
    EXPECT_TRUE(stopped) << i << ": " << stopped.error();
  }
  EXPECT_EQ(answer_to(silent.front()).status, WelcomeStatus::refused);
  EXPECT_TRUE(answer_to(operators.front().connection).hung_up);
  EXPECT_GE(server.stopped().refusals().silent, 2 * kMaxAsking);
}

// A policy's process that opens all it can get: the owner has room for as many as ever.
TEST_F(Rendezvous, ThePolicysUserKeepsNoOperatorOut) {
  if (geteuid() != 0) GTEST_SKIP() << "SKIPPED: only root can connect as another user";
  Handlers handlers = admit_all();
  handlers.request = [](const Peer&, const OperatorMessage&, std::string_view) { return OperatorReply{}; };
  const ServerThread server(path_, handlers, geteuid(), kPolicyUser);
  let_everybody_in();
  ASSERT_EQ(seteuid(kPolicyUser), 0);
  std::vector<Lease> leases;
  while (leases.size() < kMaxPolicyConnections) {
    auto lease = attach(path_, hello_of(Role::sensor_reader), kTimeout);
    if (!lease) break;
    leases.push_back(std::move(*lease));
  }
  const auto one_more = attach(path_, hello_of(Role::policy), kTimeout);
  ASSERT_EQ(seteuid(0), 0);
  EXPECT_EQ(leases.size(), kMaxPolicyConnections);
  ASSERT_FALSE(one_more);
  EXPECT_TRUE(contains(one_more.error(), "8 connections")) << one_more.error();
  while (leases.size() < kMaxPolicyConnections + kMaxReaders) {
    auto lease = attach(path_, hello_of(Role::sensor_reader), kTimeout);
    ASSERT_TRUE(lease) << lease.error();
    leases.push_back(std::move(*lease));
  }
  const auto stopped = ask(path_, OperatorVerb::stop, kTimeout);
  EXPECT_TRUE(stopped) << stopped.error();
}

TEST_F(Rendezvous, OperatorsAskAndOverlap) {
  Handlers handlers = admit_all();
  handlers.request = [](const Peer&, const OperatorMessage& message, std::string_view) {
    OperatorReply reply;
    reply.done = message.verb == OperatorVerb::arm ? 1 : 0;
    reply.status.ticks = 1234;
    std::strncpy(reply.sentences, "no policy attached", sizeof reply.sentences - 1);
    return reply;
  };
  const ServerThread server(path_, handlers);
  const auto idle = attach(path_, hello_of(Role::operator_console), kTimeout);
  ASSERT_TRUE(idle);
  const auto armed = ask(path_, OperatorVerb::arm, kTimeout);
  ASSERT_TRUE(armed) << armed.error();
  EXPECT_EQ(armed->done, 1);
  EXPECT_EQ(armed->status.ticks, 1234U);
  const auto stopped = ask(path_, OperatorVerb::stop, kTimeout);
  ASSERT_TRUE(stopped) << stopped.error();
  EXPECT_EQ(stopped->done, 0);
  EXPECT_STREQ(stopped->sentences, "no policy attached");
}

// Goal: what an operator says of a mark arrives as it may be shown, and no other request carries text. Method: a text
// with control characters, one at its limit, one beyond, which the client cuts off; and raw messages that are longer
// than their request.
TEST_F(Rendezvous, AMarkCarriesText) {
  std::vector<std::string> texts;
  Handlers handlers = admit_all();
  handlers.request = [&](const Peer&, const OperatorMessage&, std::string_view text) {
    texts.emplace_back(text);
    return OperatorReply{.done = 1, .status = {}, .incident = {}};
  };
  {
    const ServerThread server(path_, handlers);
    for (const std::string& text : {std::string(), std::string("the \x1b[2Jgripper slips"),
                                    std::string(kLongestMark, 'x'), std::string(kLongestMark + 50, 'y')})
      EXPECT_TRUE(ask(path_, OperatorVerb::mark, kTimeout, 0, text));
    for (const auto& [verb, bytes] :
         {std::pair(OperatorVerb::mark, kLongestMark + 1), {OperatorVerb::arm, std::size_t{1}}}) {
      const auto lease = attach(path_, hello_of(Role::operator_console), kTimeout);
      ASSERT_TRUE(lease);
      OperatorMessage message;
      message.verb = verb;
      std::string raw(sizeof message + bytes, 'z');
      std::memcpy(raw.data(), &message, sizeof message);
      ASSERT_EQ(send(lease->connection.get(), raw.data(), raw.size(), 0), static_cast<ssize_t>(raw.size()));
      Welcome refusal;
      ASSERT_EQ(recv(lease->connection.get(), &refusal, sizeof refusal, 0), static_cast<ssize_t>(sizeof refusal));
      EXPECT_STREQ(refusal.sentence, "not an operator's request");
    }
  }
  EXPECT_EQ(texts, (std::vector<std::string>{"", "the ?[2Jgripper slips", std::string(kLongestMark, 'x'),
                                             std::string(kLongestMark, 'y')}));
}

TEST_F(Rendezvous, EvictionEndsTheLeaseAtOnce) {
  std::atomic<int> departures = 0;
  Handlers handlers = admit_all();
  handlers.left = [&](const Peer&) { ++departures; };
  ServerThread server(path_, handlers);
  const auto lease = attach(path_, hello_of(Role::policy), kTimeout);
  ASSERT_TRUE(lease);
  RendezvousServer& inspected = server.stopped();
  ASSERT_NE(inspected.holder(Role::policy), nullptr);
  EXPECT_EQ(inspected.holder(Role::monitor), nullptr);
  inspected.evict(Role::policy);
  EXPECT_EQ(inspected.holder(Role::policy), nullptr);
  EXPECT_EQ(departures, 1);
  EXPECT_TRUE(is_over(*lease));
}

// Threat: user-connects
TEST_F(Rendezvous, OtherUsersAreRefused) {
  if (geteuid() != 0) GTEST_SKIP() << "SKIPPED: only root can connect as another user";
  const ServerThread server(path_, admit_all());
  // Credentials are those of connect(): this thread connects as user 65534, then becomes root again.
  let_everybody_in();
  ASSERT_EQ(seteuid(65534), 0);
  const auto lease = attach(path_, hello_of(Role::policy), kTimeout);
  ASSERT_EQ(seteuid(0), 0);
  ASSERT_FALSE(lease);
  EXPECT_TRUE(contains(lease.error(), "user 65534 may not connect")) << lease.error();
}

// The policy's own user lends a policy and reads sensors; it neither asks nor records.
// Threat: policy-user
TEST_F(Rendezvous, ThePolicysUserMayOnlyBeAPolicy) {
  if (geteuid() != 0) GTEST_SKIP() << "SKIPPED: only root can connect as another user";
  const ServerThread server(path_, admit_all(), geteuid(), kPolicyUser);
  let_everybody_in();
  ASSERT_EQ(seteuid(kPolicyUser), 0);
  const auto policy = attach(path_, hello_of(Role::policy), kTimeout);
  const auto sensor = attach(path_, hello_of(Role::sensor_reader), kTimeout);
  const auto monitor = attach(path_, hello_of(Role::monitor), kTimeout);
  const auto request = ask(path_, OperatorVerb::arm, kTimeout);
  ASSERT_EQ(seteuid(0), 0);
  EXPECT_TRUE(policy) << policy.error();
  EXPECT_TRUE(sensor) << sensor.error();
  ASSERT_FALSE(monitor);
  EXPECT_TRUE(contains(monitor.error(), "user 65534 is the policy's and may not be monitor")) << monitor.error();
  EXPECT_FALSE(request);
}

// Root's `takt run` gives each policy a user of its own, whom no option names; under systemd options name them.
TEST_F(Rendezvous, AUserOfOnesOwnIsAPolicyAndWhereOthersHaveNamesACandidateOnly) {
  if (geteuid() != 0) GTEST_SKIP() << "SKIPPED: only root can connect as another user";
  const auto seats = [&](std::optional<uid_t> named) {
    const ServerThread server(path_, admit_all(), geteuid(), named);
    let_everybody_in();
    EXPECT_EQ(seteuid(kFirstOwnUser + 7), 0);
    std::vector<std::string> taken;
    for (const Role role : {Role::policy, Role::fallback_policy, Role::candidate_policy, Role::sensor_reader,
                            Role::monitor, Role::viewer, Role::input_reader})
      if (attach(path_, hello_of(role), kTimeout)) taken.emplace_back(name(role));
    if (ask(path_, OperatorVerb::arm, kTimeout)) taken.emplace_back("asks");
    EXPECT_EQ(seteuid(0), 0);
    return taken;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(seats({}), (Names{"policy", "fallback policy", "candidate policy", "sensor reader"}));
  EXPECT_EQ(seats(kPolicyUser), (Names{"candidate policy", "sensor reader"}));
}

TEST_F(Rendezvous, APolicyThatTakesAllConnectionsOfItsUserTakesNoneOfAnothers) {
  if (geteuid() != 0) GTEST_SKIP() << "SKIPPED: only root can connect as another user";
  const ServerThread server(path_, admit_all(), geteuid(), kPolicyUser);
  let_everybody_in();
  std::vector<Lease> held;
  ASSERT_EQ(seteuid(kPolicyUser), 0);
  for (std::size_t i = 0; i < kMaxPolicyConnections; ++i)
    if (auto lease = attach(path_, hello_of(Role::sensor_reader), kTimeout)) held.push_back(std::move(*lease));
  const auto more = attach(path_, hello_of(Role::policy), kTimeout);
  ASSERT_EQ(seteuid(0), 0);
  ASSERT_EQ(seteuid(kFirstOwnUser + 7), 0);
  const auto other = attach(path_, hello_of(Role::candidate_policy), kTimeout);
  ASSERT_EQ(seteuid(0), 0);
  EXPECT_EQ(held.size(), kMaxPolicyConnections);
  EXPECT_FALSE(more);
  EXPECT_TRUE(other) << other.error();
}

// Threat: policy-seat
TEST(PolicyUsers, HaveASeatEach) {
  constexpr uid_t kMain = 1, kFallback = 2, kBridge = 3, kOther = 4;
  const PolicyUsers all{.policy = kMain, .fallback = kFallback, .bridge = kBridge};
  const auto seats = [](const PolicyUsers& users, uid_t uid) {
    std::string taken;
    for (const Role role : {Role::policy, Role::fallback_policy, Role::candidate_policy})
      taken += users.include(uid) && users.may_be(uid, role) ? '1' : '0';
    return taken;
  };
  EXPECT_EQ(seats(all, kMain), "101");
  EXPECT_EQ(seats(all, kFallback), "010");
  EXPECT_EQ(seats(all, kBridge), "100");
  EXPECT_EQ(seats(all, kOther), "000");
  EXPECT_EQ(seats({.policy = kMain}, kMain), "111") << "a machine without the other users";
  const auto root = PolicyUsers::around(0);
  EXPECT_EQ(root.policy, 0U);
  EXPECT_FALSE(root.fallback) << "no machine has a user root-fallback";
}

TEST_F(Rendezvous, ClientSaysWhatIsWrongWithoutAServer) {
  const auto absent = attach(path_, hello_of(Role::policy), kTimeout);
  ASSERT_FALSE(absent);
  EXPECT_TRUE(contains(absent.error(), "no process listens at " + path_)) << absent.error();
  const auto no_sensor = attach(path_ + ".d/sensor-cam0.sock", hello_of(Role::sensor_reader), kTimeout);
  ASSERT_FALSE(no_sensor);
  EXPECT_TRUE(contains(no_sensor.error(), "start the sensor's own program")) << no_sensor.error();

  // A server that never answers: its backlog takes the connection and serves none.
  auto idle = RendezvousServer::listen(path_, geteuid(), admit_all());
  ASSERT_TRUE(idle);
  const auto unanswered = attach(path_, hello_of(Role::policy), std::chrono::milliseconds(20));
  ASSERT_FALSE(unanswered);
  EXPECT_TRUE(contains(unanswered.error(), "did not answer in time")) << unanswered.error();
}

// Goal: a server's refusal is a sentence for a terminal, whichever process serves. Method: one that moves the cursor,
// has no end and is no UTF-8; and one without a word.
TEST_F(Rendezvous, ClientShowsNoRefusalThatATerminalObeys) {
  std::filesystem::create_directories(directory_.path("run/arm"));
  const auto listener = listen_at(path_);
  ASSERT_TRUE(listener) << listener.error();
  const auto refused_with = [&](const Welcome& welcome) {
    const std::jthread server([&] {
      pollfd newcomer{listener->get(), POLLIN, 0};  // whose accept() does not wait
      EXPECT_EQ(poll(&newcomer, 1, -1), 1);
      const Descriptor socket(accept(listener->get(), nullptr, nullptr));
      Hello hello;
      EXPECT_EQ(recv(socket.get(), &hello, sizeof hello, 0), static_cast<ssize_t>(sizeof hello));
      say(socket, &welcome, sizeof welcome);
    });
    const auto lease = attach(path_, hello_of(Role::viewer), kTimeout);
    return lease ? std::string("accepted") : lease.error();
  };
  Welcome welcome;
  std::memset(welcome.sentence, 'x', sizeof welcome.sentence);
  std::memcpy(welcome.sentence, "no\x1b[2J\n\xC2\x9b", 9);
  const std::string shown = refused_with(welcome);
  EXPECT_TRUE(shown.starts_with("no?[2J???x")) << shown;
  EXPECT_EQ(shown.size(), sizeof welcome.sentence - 1);
  EXPECT_TRUE(contains(refused_with(Welcome{}), "does not say why")) << "no words at all";
}

}  // namespace
}  // namespace takt::ipc
