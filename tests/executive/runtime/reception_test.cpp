// SPDX-License-Identifier: Apache-2.0
// Goal: each role gets what is its own, a refusal says why, and requests reach the loop. Method: the real socket served
// by the real reception in a thread, with a real loop in virtual drives' company; clients as the other programs are.
#include "executive/runtime/reception.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "executive/ipc/stop_line.hpp"
#include "executive/runtime/control_thread.hpp"
#include "executive/runtime/open_edge.hpp"
#include "executive/runtime/stop_thread.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "tests/executive/runtime/holding_policy.hpp"
#include "tests/executive/runtime/simulated_drives.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::runtime::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::MatchesRegex;

constexpr std::uint64_t kPolicyHash = 0x1122334455667788;
constexpr std::uint64_t kFallbackHash = 0x8877665544332211;
constexpr std::uint64_t kCandidateHash = 0x0CA11;

// An executive but for main(): a loop without real-time scheduling, and its reception.
class ReceptionTest : public testing::Test {
 protected:
  // `unrecorded_limit` 0: no recorder is required, and these tests have none.
  explicit ReceptionTest(std::uint32_t unrecorded_limit = 0, bool with_fallback = false) {
    config_->unrecorded_limit = unrecorded_limit;
    if (with_fallback) {
      config_->degraded = pipeline::DegradedBehaviour::fallback;
      config_->fallback = pipeline::FallbackKind::policy;
      config_->fallback_policy.hash = kFallbackHash;
    }
    // The loop runs without real-time scheduling here: limits that a busy machine does not reach.
    config_->feedback_timeout = robot_.feedback.timeout = seconds(1);
    config_->enable_timeout = seconds(10);
    config_->late_share = 1;
    config_->freshness.max_age = seconds(2);
    config_->freshness.stop_after = seconds(3);
    drives_ = std::make_unique<SimulatedDrives>(robot_, directory_.path());
    edge_ = std::make_unique<DriveEdge>(open_edge(robot_, directory_.path(), 5s).value().edge);
    loop_ = std::make_unique<CyclicLoop>(
        LoopParts{*config_, clock_, *edge_, mailboxes_, requests_, recorded_, published_, board_},
        LoopTiming{{}, {}, 1000});
    follower_ = std::make_unique<TickFollower>(published_.tick_reader(), *config_, [](const TickRecord&) {});
    follower_->tell(incidents_);
    auto opened = Reception::open(
        path(), {robot_, *config_, rules(), published_, mailboxes_, requests_, recorded_, board_, *follower_});
    EXPECT_TRUE(opened) << opened.error();
    reception_ = std::move(*opened);
    reception_->set_realtime(true, false);
    control_ = std::thread([this] { loop_->run(EvidenceSource::open().value()); });
    service_ = std::thread([this] {
      while (!done_) {
        reception_->serve(2ms);
        follower_->catch_up();
      }
    });
  }
  ~ReceptionTest() override {
    done_ = true;
    service_.join();
    loop_->finish();
    control_.join();
    drives_.reset();
    reception_.reset();
  }

  [[nodiscard]] std::string path() const { return config::executive_socket(directory_.path()); }
  [[nodiscard]] Hello hello(Role role) const {
    Hello hello;
    hello.role = role;
    hello.config_hash = robot_.hash;
    hello.policy_hash = role == Role::fallback_policy    ? kFallbackHash
                        : role == Role::candidate_policy ? kCandidateHash
                                                         : kPolicyHash;
    hello.joint_names_hash = config::joint_names_hash(robot_);
    hello.joint_count = static_cast<std::uint32_t>(robot_.joints.size());
    hello.step_count = robot_.policy->steps;
    return hello;
  }
  [[nodiscard]] OperatorReply ask(OperatorVerb verb, std::uint64_t policy_hash = 0) const {
    auto reply = ipc::ask(path(), verb, 5s, policy_hash);
    EXPECT_TRUE(reply) << reply.error();
    return reply.value_or(OperatorReply{});
  }
  // Polls for a state; the bound only ends a broken run.
  bool until(const std::function<bool(const StatusSnapshot&)>& holds) const {
    for (int i = 0; i < 2000; ++i) {
      if (holds(ask(OperatorVerb::status).status)) return true;
      std::this_thread::sleep_for(5ms);
    }
    const OperatorReply last = ask(OperatorVerb::status);
    std::cerr << "it stands in " << name(last.status.tick.mode) << ": " << last.incident.sentence << "\n";
    return false;
  }
  // Attaches, plays, and has it acknowledged.
  struct Attached {
    ipc::Lease lease;
    std::unique_ptr<HoldingPolicy> policy;
  };
  Attached attach_policy(Role role = Role::policy, bool plays = true) const {
    Attached attached;
    attached.lease = ipc::attach(path(), hello(role), 5s).value();
    attached.policy = std::make_unique<HoldingPolicy>(
        attached.lease.descriptors.at(ipc::kObservationDescriptor).get(),
        attached.lease.descriptors.at(ipc::kCommandDescriptor).get(), hello(role).policy_hash,
        static_cast<std::uint16_t>(robot_.policy->steps), robot_.policy->step_period);
    EXPECT_TRUE(ipc::acknowledge(attached.lease));
    if (plays) attached.policy->start();
    return attached;
  }
  std::string arm_until_granted() const {
    OperatorReply reply;
    for (int i = 0; i < 400; ++i) {
      reply = ask(OperatorVerb::arm);
      if (reply.done != 0) return {};
      std::this_thread::sleep_for(10ms);
    }
    return reply.sentences;
  }

  const takt::test::TemporaryDirectory directory_;
  config::RobotConfig robot_ = config::load("config/arm6.yaml").value();
  std::unique_ptr<pipeline::TickConfig> config_ =
      std::make_unique<pipeline::TickConfig>(setup::tick_config_of(robot_, kPolicyHash));
  std::unique_ptr<SimulatedDrives> drives_;
  std::unique_ptr<DriveEdge> edge_;
  SystemClock clock_;
  PerSeat<AdmissionRules> rules() const {
    const AdmissionRules policy = admission_rules(robot_, kPolicyHash);
    return {{policy, admission_rules(robot_, kFallbackHash), policy}};
  }
  PerSeat<MailboxHandover> mailboxes_;
  OperatorInbox requests_;
  RecordedThrough recorded_;
  StatusBoard board_;
  PublishedSegments published_ = PublishedSegments::create(robot_.joints.size()).value();
  std::unique_ptr<CyclicLoop> loop_;
  incident::IncidentWatch incidents_{robot_};
  std::unique_ptr<TickFollower> follower_;
  std::unique_ptr<Reception> reception_;
  std::atomic<bool> done_ = false;
  std::thread control_, service_;
};

TEST_F(ReceptionTest, ASecondExecutiveIsTurnedAway) {
  auto second = Reception::open(
      path(), {robot_, *config_, rules(), published_, mailboxes_, requests_, recorded_, board_, *follower_});
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error(), HasSubstr(path()));
}

TEST_F(ReceptionTest, AMonitorGetsFourRingsItCannotWrite) {
  const auto lease = ipc::attach(path(), hello(Role::monitor), 5s);
  ASSERT_TRUE(lease) << lease.error();
  ASSERT_EQ(lease->descriptors.size(), 4U);
  const auto shape = ipc::tick_ring(robot_.joints.size());
  const int ticks = lease->descriptors[ipc::kTickRingDescriptor].get();
  EXPECT_FALSE(ipc::Segment::adopt_writable(dup(ticks), ipc::ring_bytes(shape))) << "sealed against writers";
  const auto segment = ipc::Segment::adopt_read_only(dup(ticks), ipc::ring_bytes(shape));
  ASSERT_TRUE(segment) << segment.error();
  EXPECT_TRUE(ipc::SlotReader::attach(segment->readable(), shape));
  EXPECT_TRUE(until([](const StatusSnapshot& s) { return s.monitor_pid == static_cast<std::uint64_t>(getpid()); }));
}

// Goal: who records a policy's inputs misses nothing of any session: the ring is there before the policy, no other may
// write it once the policy came, and when the policy leaves its reader is sent away and finds the next session's.
// Method: a policy in this process that comes, writes and leaves, twice; a reader by the executive's socket.
TEST_F(ReceptionTest, AReaderOfInputsIsHandedOneSessionAfterTheOther) {
  const std::size_t largest = config::largest_policy_input(robot_);
  const auto shape = ipc::policy_input_ring(largest);
  const std::size_t bytes = ipc::ring_bytes(shape);
  for (const char said : {'a', 'b'}) {
    const auto reader = ipc::attach(path(), hello(Role::input_reader), 5s);
    ASSERT_TRUE(reader) << reader.error();
    const auto mapped = ipc::Segment::adopt_read_only(dup(reader->descriptors.at(0).get()), bytes);
    ASSERT_TRUE(mapped) << mapped.error();
    EXPECT_FALSE(ipc::SlotReader::attach(mapped->readable(), shape)) << "nobody formatted it yet";
    {
      const auto lease = ipc::attach(path(), hello(Role::policy), 5s);
      ASSERT_TRUE(lease) << lease.error();
      auto written = ipc::Segment::adopt_writable(dup(lease->descriptors.at(ipc::kInputDescriptor).get()), bytes);
      ASSERT_TRUE(written) << written.error();
      auto commands = ipc::Segment::adopt_writable(dup(lease->descriptors.at(ipc::kCommandDescriptor).get()),
                                                   ipc::ring_bytes(ipc::command_mailbox()));
      const ipc::SlotWriter formatted(commands->writable(), ipc::command_mailbox());
      ipc::SlotWriter writer(written->writable(), shape);
      ASSERT_TRUE(ipc::acknowledge(*lease));
      ASSERT_TRUE(until([](const StatusSnapshot& s) {
        return s.policy_pids[Seat::policy] != 0 && s.tick.seats[Seat::policy].session != 0;
      }));
      EXPECT_FALSE(ipc::Segment::adopt_writable(dup(reader->descriptors.at(0).get()), bytes)) << "sealed";
      writer.publish(std::as_bytes(std::span(&said, 1)));
      EXPECT_FALSE(ipc::is_over(*reader));
    }
    ASSERT_TRUE(until([&](const StatusSnapshot&) { return ipc::is_over(*reader); }));
    auto ring = ipc::SlotReader::attach(mapped->readable(), shape);
    ASSERT_TRUE(ring) << ring.error();
    char heard = 0;
    EXPECT_EQ(ring->read_next(std::as_writable_bytes(std::span(&heard, 1))).status, ipc::ReadStatus::fresh);
    EXPECT_EQ(heard, said) << "of this session, and nothing before it";
  }
}

TEST_F(ReceptionTest, ViewersReadBesideTheMonitor) {
  const auto monitor = ipc::attach(path(), hello(Role::monitor), 5s);
  const auto one = ipc::attach(path(), hello(Role::viewer), 5s);
  const auto another = ipc::attach(path(), hello(Role::viewer), 5s);
  ASSERT_TRUE(monitor && one && another);
  const auto shape = ipc::tick_ring(robot_.joints.size());
  const int ticks = another->descriptors.at(ipc::kTickRingDescriptor).get();
  EXPECT_FALSE(ipc::Segment::adopt_writable(dup(ticks), ipc::ring_bytes(shape))) << "sealed against writers";
  EXPECT_TRUE(until([](const StatusSnapshot& s) { return s.monitor_pid == static_cast<std::uint64_t>(getpid()); }));
}

// Goal: a person changes the policy of a robot by name, hears why where that cannot be, and in the candidate's place
// no other may come back. Method: two policies in this process, each at a mailbox of its own; the loop's real
// mailboxes change places.
TEST_F(ReceptionTest, ACandidateIsSwappedInByNameAndGivenBack) {
  Attached own = attach_policy();
  ASSERT_TRUE(until([](const StatusSnapshot& s) { return s.tick.seats[Seat::policy].freshness == Freshness::fresh; }));
  EXPECT_THAT(ask(OperatorVerb::swap, kCandidateHash).sentences, HasSubstr("no candidate runs"));
  EXPECT_THAT(ask(OperatorVerb::back).sentences, HasSubstr("in charge already"));
  {
    Attached candidate = attach_policy(Role::candidate_policy);
    ASSERT_TRUE(
        until([](const StatusSnapshot& s) { return s.tick.seats[Seat::candidate].freshness == Freshness::fresh; }));
    EXPECT_EQ(ask(OperatorVerb::status).status.tick.command_policy, kPolicyHash);
    EXPECT_THAT(ask(OperatorVerb::swap, 0xBAD).sentences, HasSubstr("not 0000000000000bad"));
    EXPECT_EQ(ask(OperatorVerb::swap, kCandidateHash).done, 1);
    ASSERT_TRUE(until([](const StatusSnapshot& s) { return s.tick.candidate.in_charge != 0; }));
    ASSERT_TRUE(until([](const StatusSnapshot& s) { return s.tick.command_policy == kCandidateHash; }));
    ASSERT_TRUE(until([](const StatusSnapshot& s) {
      return s.tick.seats[Seat::candidate].freshness == Freshness::fresh;
    })) << "the robot's own runs on beside it";
    EXPECT_THAT(ask(OperatorVerb::swap, kCandidateHash).sentences, HasSubstr("in charge already"));
  }
  ASSERT_TRUE(until([](const StatusSnapshot& s) { return s.policy_pids[Seat::candidate] == 0; }));
  Hello another = hello(Role::candidate_policy);
  another.policy_hash = 0xBAD;
  const auto refused = ipc::attach(path(), another, 5s);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error(), HasSubstr("takt policy back"));
  EXPECT_EQ(ask(OperatorVerb::back).done, 1);
  ASSERT_TRUE(until([](const StatusSnapshot& s) { return s.tick.command_policy == kPolicyHash; }));
  EXPECT_EQ(ask(OperatorVerb::status).status.tick.candidate.in_charge, 0);
}

TEST_F(ReceptionTest, AMarkSaysWhichTickCarriesIt) {
  ASSERT_TRUE(until([](const StatusSnapshot& status) { return status.ticks > 10; }));
  const OperatorReply reply = ask(OperatorVerb::mark);
  EXPECT_EQ(reply.done, 1);
  EXPECT_THAT(reply.sentences, MatchesRegex("marked tick [0-9]+"));
  EXPECT_EQ(reply.status.tick.mode, Mode::standby) << "a mark decides nothing";
}

TEST_F(ReceptionTest, AnInadmissiblePolicyHearsWhy) {
  Hello wrong = hello(Role::policy);
  wrong.joint_count = 7;
  const auto lease = ipc::attach(path(), wrong, 5s);
  ASSERT_FALSE(lease);
  EXPECT_THAT(lease.error(), HasSubstr("7 joints, the robot has 6"));
}

TEST_F(ReceptionTest, ARobotWithoutAFallbackPolicyAdmitsNone) {
  const auto lease = ipc::attach(path(), hello(Role::fallback_policy), 5s);
  ASSERT_FALSE(lease);
  EXPECT_THAT(lease.error(), HasSubstr("has no fallback policy"));
}

class TwoPoliciesTest : public ReceptionTest {
 protected:
  TwoPoliciesTest() : ReceptionTest(0, true) {}
};

// Goal: the two have a lease, a mailbox and a session each, arming waits for both, and either may go and come back
// without the other noticing. Method: two policies in this process; the fallback leaves and returns while the robot
// tracks.
TEST_F(TwoPoliciesTest, EachHasASeatOfItsOwnAndArmingWaitsForBoth) {
  const Attached policy = attach_policy();
  ASSERT_TRUE(until(
      [](const StatusSnapshot& status) { return status.tick.seats[Seat::policy].freshness == Freshness::fresh; }));
  EXPECT_THAT(ask(OperatorVerb::arm).sentences, HasSubstr("no fresh command of the fallback policy"));
  {
    const Attached fallback = attach_policy(Role::fallback_policy);
    ASSERT_EQ(arm_until_granted(), "");
    ASSERT_TRUE(until([](const StatusSnapshot& status) {
      return status.tick.mode == Mode::tracking && status.tick.seats[Seat::fallback].session == 1 &&
             status.policy_pids[Seat::fallback] != 0;
    }));
    EXPECT_FALSE(ipc::attach(path(), hello(Role::fallback_policy), 5s)) << "its seat is taken";
  }
  ASSERT_TRUE(until([](const StatusSnapshot& status) { return status.policy_pids[Seat::fallback] == 0; }));
  const Attached successor = attach_policy(Role::fallback_policy);
  EXPECT_TRUE(until([](const StatusSnapshot& status) {
    return status.tick.seats[Seat::fallback].session == 2 &&
           status.tick.seats[Seat::fallback].freshness == Freshness::fresh;
  }));
  const StatusSnapshot status = ask(OperatorVerb::status).status;
  EXPECT_EQ(status.tick.mode, Mode::tracking);
  EXPECT_EQ(status.tick.player, Player::policy);
  EXPECT_EQ(status.tick.seats[Seat::policy].session, 1);
}

TEST_F(ReceptionTest, ASensorReaderIsSentElsewhere) {
  const auto lease = ipc::attach(path(), hello(Role::sensor_reader), 5s);
  ASSERT_FALSE(lease);
  EXPECT_THAT(lease.error(), HasSubstr("sensor-<name>.sock"));
}

TEST_F(ReceptionTest, ArmingIsRefusedWithTheListOfWhatIsMissing) {
  ASSERT_TRUE(until([](const StatusSnapshot& status) { return status.ticks > 50; }));
  drives_->stop();
  ASSERT_TRUE(until([](const StatusSnapshot& status) { return status.tick.buses[0].state == BusState::down; }));
  constexpr std::uint64_t kFeedbackLost = std::uint64_t{1} << static_cast<unsigned>(Cause::feedback_lost);
  ASSERT_TRUE(until([](const StatusSnapshot& status) { return (status.tick.causes_active & kFeedbackLost) != 0; }));
  const OperatorReply reply = ask(OperatorVerb::arm);
  EXPECT_EQ(reply.done, 0);
  const std::string sentences = reply.sentences;
  EXPECT_THAT(sentences, HasSubstr("no policy is attached"));
  for (const config::Joint& joint : robot_.joints) EXPECT_THAT(sentences, HasSubstr("joint " + joint.name + ": "));
  EXPECT_EQ(ask(OperatorVerb::status).status.tick.mode, Mode::standby);
}

// Goal: a stop in standby ends the asking of a program that waits to arm, as `takt run --arm`. Method: one process asks
// for arming, which is refused, for a stop, and for arming again; a reset of its own makes it a new question.
TEST_F(ReceptionTest, AStopEndsAPendingArming) {
  ASSERT_TRUE(until([](const StatusSnapshot& status) { return status.ticks > 50; }));
  for (const OperatorVerb stop : {OperatorVerb::press_stop, OperatorVerb::stop, OperatorVerb::deenergise}) {
    EXPECT_THAT(ask(OperatorVerb::arm).sentences, HasSubstr("no policy is attached"));
    EXPECT_EQ(ask(stop).done, 1);
    for (int time = 0; time < 3; ++time)
      EXPECT_THAT(ask(OperatorVerb::arm).sentences, HasSubstr("a stop was asked for since this command began to ask"));
    EXPECT_EQ(ask(OperatorVerb::reset).status.tick.mode, Mode::standby);
  }
}

// Goal: who is refused because another stopped the robot learns who that was. Method: a stop by this process.
TEST_F(ReceptionTest, ARefusedArmingSaysWhoStoppedTheRobot) {
  const Attached attached = attach_policy();
  ASSERT_EQ(arm_until_granted(), "");
  EXPECT_EQ(ask(OperatorVerb::stop).done, 1);
  const std::string program = std::string(program_invocation_short_name).substr(0, 15);
  ASSERT_TRUE(until([](const StatusSnapshot& status) { return status.tick.mode == Mode::damped_stop; }));
  EXPECT_THAT(ask(OperatorVerb::arm).sentences,
              HasSubstr(fmt::format("a stop was asked for by {} (pid {}), user {}", program, getpid(), getuid())));
}

// Goal: no stop is ascribed to who asked for an earlier one. Method: a stop, a refused and a granted reset, in the log
// alone.
TEST(OperatorLog, ForgetsWhoStoppedOnceTheRobotIsReset) {
  OperatorLog log;
  const ipc::Peer peer{.hello = {}, .pid = getpid(), .uid = getuid()};
  const auto note = [&](OperatorVerb verb, bool done) {
    OperatorReply reply;
    reply.done = done ? 1 : 0;
    log.note(peer, verb, reply, MonoTime{1});
  };
  note(OperatorVerb::stop, false);
  EXPECT_EQ(log.last_stop(), "") << "it came to nothing";
  note(OperatorVerb::press_stop, true);
  note(OperatorVerb::reset, false);
  EXPECT_THAT(log.last_stop(), HasSubstr(fmt::format("(pid {})", getpid())));
  note(OperatorVerb::reset, true);
  EXPECT_EQ(log.last_stop(), "");
}

// Goal: who arms at once after a reset is not refused for want of a command that is on its way. Method: a policy that
// is silent, and nothing else missing, then drives that are silent too: the refusal comes once the policy has had its
// time, and no earlier.
TEST_F(ReceptionTest, ArmingWaitsForTheFirstCommand) {
  const Attached attached = attach_policy(Role::policy, false);
  const auto refusal = [this] { return std::string(ask(OperatorVerb::arm).sentences); };
  const std::string alone = "no fresh command: the policy host's log says why, docs/troubleshooting.md what to do";
  ASSERT_TRUE(until([&](const StatusSnapshot&) { return refusal() == alone; }));
  const auto asked_at = std::chrono::steady_clock::now();
  EXPECT_EQ(refusal(), alone);
  EXPECT_GE(std::chrono::steady_clock::now() - asked_at, kRequestPatience);
  drives_->stop();
  ASSERT_TRUE(until([&](const StatusSnapshot&) { return refusal().find("no recent feedback") != std::string::npos; }));
  const auto asked_again_at = std::chrono::steady_clock::now();
  EXPECT_THAT(refusal(), HasSubstr(alone));
  EXPECT_GE(std::chrono::steady_clock::now() - asked_again_at, kRequestPatience);
}

// Goal: what a policy's host says kept it from answering stands in the place of the question whether it runs, in the
// status, and with the monitor, who comes later too; that it is over, likewise.
TEST_F(ReceptionTest, WhatKeepsAPolicyFromAnsweringIsTold) {
  const Attached attached = attach_policy(Role::policy, false);
  const ipc::Lease& policy = attached.lease;
  const auto says = [this](OperatorVerb verb, const std::string& sentence) {
    for (int i = 0; i < 400; ++i, std::this_thread::sleep_for(5ms))
      if (std::string(ask(verb).sentences).find(sentence) != std::string::npos) return true;
    return false;
  };
  EXPECT_TRUE(says(OperatorVerb::arm, "no fresh command: the policy host's log says why"));
  ipc::tell(policy, PolicyWordKind::problem, "sensor target: no sample yet");
  EXPECT_TRUE(says(OperatorVerb::arm, "no fresh command: sensor target: no sample yet"));
  EXPECT_TRUE(says(OperatorVerb::status, "policy: sensor target: no sample yet"));
  const ipc::Lease monitor = ipc::attach(path(), hello(Role::monitor), 5s).value();
  const auto hears = [&](const std::string& sentence) {
    for (int i = 0; i < 400; ++i, std::this_thread::sleep_for(5ms))
      if (const auto any = ipc::next_word(monitor))
        if (const auto* const word = std::get_if<PolicyWord>(&*any))
          return word->sentence == sentence && word->role == Role::policy;
    return false;
  };
  EXPECT_TRUE(hears("sensor target: no sample yet"));
  ipc::tell(policy, PolicyWordKind::problem, "");
  EXPECT_TRUE(hears(""));
  EXPECT_TRUE(says(OperatorVerb::arm, "no fresh command: the policy host's log says why"));
}

// Also what was asked before a recorder came.
TEST_F(ReceptionTest, TheRecorderHearsWhoAskedForWhat) {
  (void)ask(OperatorVerb::status);
  (void)ask(OperatorVerb::arm);
  const ipc::Lease monitor = ipc::attach(path(), hello(Role::monitor), 5s).value();
  const auto next = [&]() -> std::optional<OperatorWord> {
    for (int i = 0; i < 400; ++i, std::this_thread::sleep_for(5ms))
      if (const auto any = ipc::next_word(monitor))
        if (const auto* const word = std::get_if<OperatorWord>(&*any)) return *word;
    return std::nullopt;
  };
  const auto arm = next();
  ASSERT_TRUE(arm);
  EXPECT_EQ(arm->verb, OperatorVerb::arm);
  EXPECT_EQ(arm->done, 0);
  EXPECT_EQ(arm->pid, getpid());
  EXPECT_EQ(arm->uid, getuid());
  EXPECT_STREQ(arm->program, std::string(program_invocation_short_name).substr(0, 15).c_str());
  EXPECT_STRNE(arm->answer, "");
  (void)ask(OperatorVerb::mark);
  const auto mark = next();
  ASSERT_TRUE(mark);
  EXPECT_EQ(mark->verb, OperatorVerb::mark);
}

// Goal: a host that hangs, and so says nothing, is named. Method: one that is attached and publishes nothing.
TEST_F(ReceptionTest, AHostThatSaysNothingIsNamed) {
  const Attached attached = attach_policy(Role::policy, false);
  EXPECT_TRUE(until([this](const StatusSnapshot&) {
    return std::string(ask(OperatorVerb::status).sentences).find("is attached and says nothing: it hangs") !=
           std::string::npos;
  }));
}

// Goal: joints that fell silent are named, and not the host that has nothing to answer. Method: the same host, and
// drives that end.
TEST_F(ReceptionTest, SilentJointsAreNamedAndNotTheHost) {
  const Attached attached = attach_policy(Role::policy, false);
  drives_->stop();
  EXPECT_TRUE(until([this](const StatusSnapshot&) {
    return std::string(ask(OperatorVerb::status).sentences).find("policy: it gets no fresh observation: joints ") !=
           std::string::npos;
  }));
}

TEST_F(ReceptionTest, StatusRepeatsEveryWatchdogWaiver) {
  EXPECT_THAT(ask(OperatorVerb::status).sentences, testing::Not(HasSubstr("watchdog_waiver")));
  robot_.joints[1].drive.watchdog_waiver = "seen to stop within 100 ms";
  EXPECT_THAT(ask(OperatorVerb::status).sentences,
              HasSubstr("joint " + robot_.joints[1].name +
                        ": its drive has no command timeout (watchdog_waiver: seen "
                        "to stop within 100 ms)"));
}

TEST_F(ReceptionTest, APolicyIsPlayedThenStoppedAndReset) {
  Attached attached = attach_policy();
  EXPECT_EQ(arm_until_granted(), "");
  EXPECT_TRUE(until([](const StatusSnapshot& status) { return status.tick.mode == Mode::tracking; }));
  EXPECT_TRUE(drives_->all_enabled());
  EXPECT_GT(ask(OperatorVerb::status).status.arrivals[static_cast<std::size_t>(Arrival::accepted)], 0U);

  const OperatorReply again = ask(OperatorVerb::arm);
  EXPECT_EQ(again.done, 0);
  EXPECT_THAT(again.sentences, HasSubstr("already armed"));
  const OperatorReply early = ask(OperatorVerb::reset);
  EXPECT_EQ(early.done, 0);
  EXPECT_THAT(early.sentences, HasSubstr("stop it first"));

  EXPECT_EQ(ask(OperatorVerb::stop).done, 1);
  EXPECT_EQ(ask(OperatorVerb::status).status.tick.mode, Mode::damped_stop);
  ASSERT_TRUE(until([this](const StatusSnapshot&) {
    const OperatorReply reply = ask(OperatorVerb::reset);
    if (reply.done == 0) {
      EXPECT_THAT(reply.sentences, HasSubstr("takt stop --now")) << "the way for what never rests";
    }
    return reply.done == 1;
  }));
  EXPECT_EQ(ask(OperatorVerb::status).status.tick.mode, Mode::standby);
  EXPECT_TRUE(until([this](const StatusSnapshot&) { return drives_->all_disabled(); }));
}

// The stop's own way is served while the reception is not: the request is read by a tick before any thread answers.
TEST_F(ReceptionTest, AStopReachesTheTickWhileNobodyReceives) {
  const auto stops = StopThread::start(ipc::stop_socket_beside(path()), requests_).value();
  Attached attached = attach_policy();
  ASSERT_EQ(arm_until_granted(), "");
  done_ = true;
  service_.join();
  auto ticks = published_.tick_reader();
  const auto unanswered = ipc::ask(path(), OperatorVerb::press_stop, 200ms);
  ASSERT_FALSE(unanswered);
  EXPECT_THAT(unanswered.error(), HasSubstr("the stop was handed over"));
  bool stopped = false;
  for (int i = 0; i < 2000 && !stopped; ++i) {
    TickRecord record{};
    while (ticks.read_next(std::as_writable_bytes(std::span(&record, 1))).status == ipc::ReadStatus::fresh)
      stopped |= record.header.cause == Cause::operator_stop;
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_TRUE(stopped);
  done_ = false;
  service_ = std::thread([this] {
    while (!done_) {
      reception_->serve(2ms);
      follower_->catch_up();
    }
  });
}

// A stop that no tick reads is a stop that was taken, and the answer says what is wrong. Method: the loop has ended.
TEST_F(ReceptionTest, AStopThatNoTickReadsIsTakenAndSaysSo) {
  loop_->finish();
  control_.join();
  for (const OperatorVerb verb : {OperatorVerb::stop, OperatorVerb::press_stop, OperatorVerb::deenergise}) {
    const OperatorReply reply = ask(verb);
    EXPECT_EQ(reply.done, 1);
    EXPECT_THAT(reply.sentences, HasSubstr("the control thread did not answer in time"));
  }
  EXPECT_EQ(ask(OperatorVerb::reset).done, 0) << "nor does a reset pass for one";
  control_ = std::thread([] {});
}

TEST_F(ReceptionTest, APressIsAskedForOnceAlthoughItIsAnsweredElsewhere) {
  const auto stops = StopThread::start(ipc::stop_socket_beside(path()), requests_).value();
  Attached attached = attach_policy();
  ASSERT_EQ(arm_until_granted(), "");
  EXPECT_EQ(ask(OperatorVerb::press_stop).status.tick.mode, Mode::damped_stop);
  ASSERT_TRUE(until([this](const StatusSnapshot&) {
    return ask(OperatorVerb::press_stop).status.tick.mode == Mode::standby;
  })) << "again";
  EXPECT_TRUE(until([this](const StatusSnapshot&) { return drives_->all_disabled(); }));
}

TEST_F(ReceptionTest, NowTakesThePowerAtOnce) {
  const auto stops = StopThread::start(ipc::stop_socket_beside(path()), requests_).value();
  Attached attached = attach_policy();
  ASSERT_EQ(arm_until_granted(), "");
  const OperatorReply reply = ask(OperatorVerb::deenergise);
  EXPECT_EQ(reply.done, 1);
  EXPECT_EQ(reply.status.tick.mode, Mode::standby);
  EXPECT_EQ(reply.status.tick.drives_enabled, 0);
}

TEST_F(ReceptionTest, ASecondPolicyHearsWhoHoldsTheRoleAndASuccessorMayCountFromOne) {
  {
    const Attached first = attach_policy();
    const auto second = ipc::attach(path(), hello(Role::policy), 5s);
    ASSERT_FALSE(second);
    EXPECT_THAT(second.error(), HasSubstr(std::to_string(getpid())));
    ASSERT_TRUE(until([](const StatusSnapshot& status) {
      return status.tick.seats[Seat::policy].session == 1 && status.tick.seats[Seat::policy].command_sequence > 5;
    }));
  }
  ASSERT_TRUE(until([](const StatusSnapshot& status) { return status.policy_pids[Seat::policy] == 0; }));
  const Attached successor = attach_policy();
  EXPECT_TRUE(until([](const StatusSnapshot& status) {
    return status.tick.seats[Seat::policy].session == 2 &&
           status.tick.seats[Seat::policy].freshness == Freshness::fresh;
  }));
  EXPECT_EQ(ask(OperatorVerb::status).status.arrivals[static_cast<std::size_t>(Arrival::repeated_sequence)], 0U);
}

TEST_F(ReceptionTest, ADepartedPolicysCommandsAreNoLongerRead) {
  Attached attached = attach_policy();
  ASSERT_EQ(arm_until_granted(), "");
  attached.lease = {};  // the connection ends; the mapping is still writable, and the policy goes on writing
  EXPECT_TRUE(until([](const StatusSnapshot& status) { return status.tick.mode == Mode::damped_stop; }))
      << "age alone ends what was asked for last";
}

TEST_F(ReceptionTest, WithoutRealTimeNobodyArmsUnlessAllowed) {
  done_ = true;
  service_.join();
  reception_->set_realtime(false, false);
  done_ = false;
  service_ = std::thread([this] {
    while (!done_) reception_->serve(2ms);
  });
  const OperatorReply reply = ask(OperatorVerb::arm);
  EXPECT_EQ(reply.done, 0);
  EXPECT_THAT(reply.sentences, HasSubstr("--allow-non-realtime"));
  EXPECT_EQ(reply.status.realtime, 0);
}

// A robot that may not move unrecorded, as robot files have it unless they say otherwise.
class RecordedReceptionTest : public ReceptionTest {
 protected:
  RecordedReceptionTest() : ReceptionTest(pipeline::kLongestUnrecorded) {}
  [[nodiscard]] ipc::Lease attach_monitor() const { return ipc::attach(path(), hello(Role::monitor), 5s).value(); }
  // The monitor writes every tick that was over when it was asked.
  bool until_with(const ipc::Lease& monitor, const std::function<bool(const StatusSnapshot&)>& holds) const {
    return until([&](const StatusSnapshot& status) {
      ipc::tell_recorded(monitor, status.ticks);
      return holds(status);
    });
  }
  bool arms_with(const ipc::Lease& monitor) const {
    return until_with(monitor, [this](const StatusSnapshot&) { return ask(OperatorVerb::arm).done != 0; }) &&
           until_with(monitor, [](const StatusSnapshot& status) { return status.tick.mode == Mode::tracking; });
  }
  bool stops_for_its_recorder() const {
    constexpr std::uint64_t kLost = std::uint64_t{1} << static_cast<unsigned>(Cause::recording_lost);
    return until([](const StatusSnapshot& status) {
      return status.tick.mode == Mode::damped_stop && (status.tick.causes_active & kLost) != 0;
    });
  }
};

TEST_F(RecordedReceptionTest, NobodyArmsUntilTheMonitorSaysThatItWrites) {
  const Attached policy = attach_policy();
  ASSERT_TRUE(until(
      [](const StatusSnapshot& status) { return status.tick.seats[Seat::policy].freshness == Freshness::fresh; }));
  const OperatorReply alone = ask(OperatorVerb::arm);
  EXPECT_EQ(alone.done, 0);
  EXPECT_THAT(alone.sentences, HasSubstr("nothing is recorded: start takt-monitor"));
  EXPECT_EQ(alone.status.recorder_required, 1);
  const ipc::Lease monitor = attach_monitor();
  EXPECT_EQ(ask(OperatorVerb::arm).done, 0) << "a monitor that is there has written nothing yet";
  EXPECT_TRUE(arms_with(monitor));
  EXPECT_NE(ask(OperatorVerb::status).status.tick.recorded_through, 0U);
}

TEST_F(RecordedReceptionTest, AMovingRobotStopsWhenItsRecordingEnds) {
  const Attached policy = attach_policy();
  {
    const ipc::Lease monitor = attach_monitor();
    ASSERT_TRUE(arms_with(monitor));
    ipc::tell_recorded(monitor, 0);  // a full disk
    EXPECT_TRUE(stops_for_its_recorder());
    ASSERT_TRUE(until_with(monitor, [this](const StatusSnapshot&) { return ask(OperatorVerb::reset).done == 1; }));
    ASSERT_TRUE(arms_with(monitor));
  }  // the monitor dies
  EXPECT_TRUE(stops_for_its_recorder());
}

TEST_F(RecordedReceptionTest, AMonitorThatIsThereButFallsBehindIsNoRecorder) {
  const Attached policy = attach_policy();
  const ipc::Lease monitor = attach_monitor();
  ASSERT_TRUE(arms_with(monitor));
  EXPECT_TRUE(stops_for_its_recorder()) << "it says nothing more";
}

}  // namespace
}  // namespace takt::runtime::test
