// SPDX-License-Identifier: Apache-2.0
// Goal: a policy on another machine moves the robot as one beside it does; and whatever happens to the network, the
// server, the clock or the other machine's programs, no command answers an observation that is older than max_age, none
// goes back, none claims to be younger than the samples it rests on, and what can work again does.
// Method: takt-policy-bridge, takt-policy-server and takt-policy-host as real processes in two network namespaces with
// a faulty wire between them (faulty_network.hpp); the test is executive and sensor, and judges every command as it
// comes against what it showed.
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "client/takt/client.h"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "tests/policy_host/fake_server.hpp"
#include "tests/process/child.hpp"
#include "tests/process/faulty_network.hpp"
#include "tests/support/files.hpp"
#include "tests/support/replaced.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::test {
namespace {

using policy_host::FakeExecutive;
using policy_host::FakeSensor;

constexpr Duration kPeriod = milliseconds(20), kMaxAge = seconds(1);

std::size_t occurrences(const std::string& text, const std::string& words) {
  std::size_t count = 0;
  for (std::size_t at = text.find(words); at != std::string::npos; at = text.find(words, at + 1)) ++count;
  return count;
}

bool until(const std::function<bool()>& holds) {
  for (int poll = 0; poll < 1500; ++poll) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return holds();
}

// The robot's camera, which lives longer than its executives.
class Camera {
 public:
  explicit Camera(const std::string& directory) : sensor_(config::sensor_socket(directory, "target")) {}
  MonoTime publish() {
    SensorSample sample;
    sample.published_at = monotonic_now();
    sample.sensed_at = sample.published_at - milliseconds(3);
    sample.value_count = 3;
    sample.values[0] = 0.3F;
    sample.values[2] = 0.4F;
    sample.sequence = ++sequence_;
    remember(sample.sensed_at);
    sensor_.publish(sample);
    return sample.sensed_at;
  }
  void remember(MonoTime stamp) {
    const std::lock_guard lock(mutex_);
    stamps_.push_back(stamp);
  }
  [[nodiscard]] bool had(MonoTime stamp) const {
    const std::lock_guard lock(mutex_);
    return std::ranges::find(stamps_, stamp) != stamps_.end();
  }

 private:
  FakeSensor sensor_;
  std::uint64_t sequence_ = 0;
  mutable std::mutex mutex_;
  std::vector<MonoTime> stamps_;  // guarded
};

// What the robot's joint j is observed to be in one of the observation's vectors.
float observed(int vector, std::size_t joint) {
  return 0.01F * static_cast<float>(10 * vector + static_cast<int>(joint) + 1);
}

// The robot's side: an executive that publishes an observation every 20 ms, and the judge of what comes.
class Robot {
 public:
  Robot(const std::string& directory, const config::RobotConfig& config, Camera& camera)
      : joints_(static_cast<std::uint32_t>(config.joints.size())),
        steps_(config.policy->steps),
        executive_(config::executive_socket(directory)),
        camera_(camera),
        thread_([this] { run(); }) {}
  ~Robot() {
    stop_ = true;
    thread_.join();
  }
  Robot(const Robot&) = delete;
  Robot& operator=(const Robot&) = delete;

  // From here on its policy answers nothing but for states that are not there yet, 30 ms ahead of each observation.
  void speculates() { speculates_ = true; }
  [[nodiscard]] std::uint64_t commands() const { return commands_; }
  [[nodiscard]] std::uint64_t newest_answered() const { return newest_answered_; }
  [[nodiscard]] std::uint64_t sequence() const { return sequence_; }  // of the newest command
  [[nodiscard]] std::uint64_t shown() const { return shown_; }
  [[nodiscard]] std::string problem() const { return executive_.said(PolicyWordKind::problem).sentence; }
  [[nodiscard]] PolicyWord source() const { return executive_.said(PolicyWordKind::source); }
  // The first thing that must never be; empty: nothing was.
  [[nodiscard]] std::string violation() const {
    const std::lock_guard lock(mutex_);
    return violation_;
  }

 private:
  void run() {
    MonoTime next = monotonic_now();
    std::uint64_t id = 0;
    while (!stop_) {
      next = std::max(next + kPeriod, monotonic_now());
      sleep_until(next);
      camera_.publish();
      Observation observation;
      observation.id = ++id;
      observation.tick = id * 20;
      observation.published_at = monotonic_now();
      observation.oldest_sensed_at = observation.published_at - milliseconds(1);
      observation.period = kPeriod;
      observation.joint_count = joints_;
      observation.mode = static_cast<std::uint8_t>(Mode::tracking);
      for (std::size_t j = 0; j < joints_; ++j) {
        observation.q[j] = observed(TAKT_TERM_Q, j);
        observation.dq[j] = observed(TAKT_TERM_DQ, j);
        observation.tau[j] = observed(TAKT_TERM_TAU, j);
        observation.q_setpoint[j] = observed(TAKT_TERM_Q_SETPOINT, j);
        observation.dq_of_drive[j] = observed(TAKT_TERM_DQ_OF_DRIVE, j);
      }
      observed_[id] = observation.published_at;
      executive_.publish(observation);
      shown_ = id;
      if (!executive_.acknowledged()) continue;
      CommandChunk chunk;
      if (executive_.read(chunk)) judge(chunk.header);
    }
  }
  void judge(const CommandHeader& command) {
    const auto found = observed_.find(command.observation_id);
    const auto expect = [&](bool holds, const char* what) {
      const std::lock_guard lock(mutex_);
      if (!holds && violation_.empty())
        violation_ = std::string(what) + " (observation " + std::to_string(command.observation_id) + ")";
    };
    expect(found != observed_.end(), "answers what was never shown");
    if (found == observed_.end()) return;
    const MonoTime shown_at = found->second;
    expect(command.observation_id >= newest_answered_, "answers an older observation than the one before");
    expect(command.sequence > sequence_, "a sequence that does not rise");
    expect(command.published_at - shown_at <= kMaxAge, "stale: published later than max_age");
    expect(command.published_at <= monotonic_now(), "published in the future");
    expect(shown_at <= command.dequeued_at && command.dequeued_at <= command.infer_started_at &&
               command.infer_started_at <= command.infer_ended_at && command.infer_ended_at <= command.published_at,
           "stamps that do not run forwards by the robot's clock");
    if (speculates_)
      expect(shown_at - command.outside_sensed_at > milliseconds(25), "younger than the observation before that");
    else
      expect(camera_.had(command.outside_sensed_at), "a sample's stamp that no sample had");
    expect(command.outside_sensed_at <= command.dequeued_at, "younger than its samples");
    expect(command.step_count == steps_ && command.joint_count == joints_, "another shape");
    newest_answered_ = command.observation_id;
    sequence_ = command.sequence;
    ++commands_;
  }

  std::uint32_t joints_, steps_;
  FakeExecutive executive_;
  Camera& camera_;
  std::map<std::uint64_t, MonoTime> observed_;  // when it was published
  std::atomic<std::uint64_t> sequence_ = 0;
  std::atomic<std::uint64_t> commands_ = 0, newest_answered_ = 0, shown_ = 0;
  mutable std::mutex mutex_;
  std::string violation_;  // guarded
  std::atomic<bool> stop_ = false, speculates_ = false;
  std::thread thread_;
};

// One machine with a policy: the server, and the host of the demo arm's network, as they are.
struct FarMachine {
  std::string directory;
  std::optional<Child> server, host;
};

class RemotePolicy : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string why = FaultyNetwork::why_not(); !why.empty())
      GTEST_SKIP() << "NO POLICY ON ANOTHER MACHINE WAS TESTED: " << why;
    network_.emplace();
    std::filesystem::create_directories(directory());
    std::ofstream(robot_file()) << robot_text();
    config_ = config::load(robot_file()).value();
    camera_.emplace(directory());
    robot_ = std::make_unique<Robot>(directory(), config_, *camera_);
    bridge_.emplace(network_->start(0, {"takt-policy-bridge", "--robot", robot_file(), "--runtime-dir", directory()},
                                    log("bridge")));
  }
  void TearDown() override {
    if (!robot_) return;
    EXPECT_EQ(robot_->violation(), "") << logs();
    bridge_->signal(SIGTERM);
    EXPECT_EQ(bridge_->wait(std::chrono::seconds(20)), 0) << logs();
  }
  [[nodiscard]] virtual std::string robot_text() const {
    std::string text = text_of("config/arm6.yaml");
    text = replaced(text, "file: arm6_reach.onnx",
                    "file: " + (std::filesystem::current_path() / "config/arm6_reach.onnx").string());
    text = replaced(text, "max_age: 150 ms", "max_age: 1 s");
    text = replaced(text, "stop_after: 600 ms", "stop_after: 3 s");
    text =
        replaced(text, "- { name: target, values: 3, timeout: 200 ms }", "- { name: target, values: 3, timeout: 2 s }");
    return text + "\ndds: { interface: takt0, peers: [{ address: 10.77.0.1 }, { address: 10.77.0.2 }] }\n";
  }
  [[nodiscard]] std::string directory() const { return temporary_.path("robot"); }
  [[nodiscard]] std::string robot_file() const { return temporary_.path("robot.yaml"); }
  [[nodiscard]] std::string log(const std::string& name) const { return temporary_.path(name + ".log"); }
  [[nodiscard]] std::string logs() const {
    std::string all;
    for (const auto& entry : std::filesystem::directory_iterator(temporary_.path()))
      if (entry.path().extension() == ".log") all += entry.path().filename().string() + ":\n" + text_of(entry.path());
    return all;
  }
  // `wrap`: words before each command line.
  FarMachine start_far(const std::string& name, const std::vector<std::string>& wrap = {},
                       std::string robot_file = {}) {
    FarMachine far{temporary_.path(name), {}, {}};
    std::filesystem::create_directories(far.directory);
    if (robot_file.empty()) robot_file = this->robot_file();
    const auto start = [&](std::vector<std::string> words) {
      words.insert(words.begin(), wrap.begin(), wrap.end());
      return network_->start(1, words, log(name));
    };
    const std::string bin = wrap.empty() ? "" : std::string(TAKT_BIN_DIR) + "/";
    far.server.emplace(
        start({bin + "takt-policy-server", "--robot", robot_file, "--runtime-dir", far.directory, "--name", name}));
    far.host.emplace(start({bin + "takt-policy-host", "--robot", robot_file, "--runtime-dir", far.directory}));
    return far;
  }
  // More commands come, each for a newer observation.
  [[nodiscard]] bool moves_on(std::uint64_t commands = 20) const {
    const std::uint64_t before = robot_->commands(), newest = robot_->shown();
    return until([&] { return robot_->commands() >= before + commands && robot_->newest_answered() > newest; });
  }
  // Nothing comes for as long as 2 * max_age takes.
  [[nodiscard]] bool falls_silent() const {
    return until([&] {
      const std::uint64_t before = robot_->commands(), shown = robot_->shown();
      const auto periods = static_cast<std::uint64_t>(2 * kMaxAge.ns / kPeriod.ns);
      until([&] { return robot_->shown() >= shown + periods; });
      return robot_->commands() == before;
    });
  }
  [[nodiscard]] bool is_said(const std::string& name, const std::string& words) const {
    return until([&] { return text_of(log(name)).find(words) != std::string::npos; });
  }

  TemporaryDirectory temporary_;
  std::optional<FaultyNetwork> network_;
  config::RobotConfig config_;
  std::optional<Camera> camera_;
  std::unique_ptr<Robot> robot_;
  std::optional<Child> bridge_;
};

TEST_F(RemotePolicy, MovesTheRobotThroughDelayJitterLossAndFramesThatComeTwice) {
  const FarMachine far = start_far("far");
  ASSERT_TRUE(moves_on()) << logs();
  network_->set({.delay = milliseconds(40), .jitter = milliseconds(60), .loss = 0.1, .twice = 0.1});
  EXPECT_TRUE(moves_on(50)) << logs();
  network_->set({.delay = milliseconds(600), .jitter = milliseconds(600), .loss = 0, .twice = 0});
  const std::uint64_t shown = robot_->shown();
  ASSERT_TRUE(until([&] { return robot_->shown() > shown + 100; }));
  network_->set({});
  EXPECT_TRUE(moves_on()) << logs();
}

TEST_F(RemotePolicy, APartitionSilencesItAndItComesBack) {
  const FarMachine far = start_far("far");
  ASSERT_TRUE(moves_on()) << logs();
  network_->set({.delay = {}, .jitter = {}, .loss = 0, .twice = 0, .is_cut = true});
  EXPECT_TRUE(falls_silent()) << logs();
  network_->set({});
  EXPECT_TRUE(moves_on()) << logs();
}

TEST_F(RemotePolicy, AServerThatStallsForSecondsAnswersNothingOfBefore) {
  const FarMachine far = start_far("far");
  ASSERT_TRUE(moves_on()) << logs();
  for (const auto* const stalled : {&far.server, &far.host}) {
    (*stalled)->signal(SIGSTOP);
    EXPECT_TRUE(falls_silent()) << logs();
    const std::uint64_t shown = robot_->shown();
    ASSERT_TRUE(until([&] { return robot_->shown() > shown + 150; })) << "5 s in all";
    (*stalled)->signal(SIGCONT);
    EXPECT_TRUE(moves_on()) << logs();
  }
}

TEST_F(RemotePolicy, DeadProgramsOfTheOtherMachineAreReplacedByNewOnes) {
  FarMachine far = start_far("far");
  ASSERT_TRUE(moves_on()) << logs();
  far.host.reset();  // killed
  EXPECT_TRUE(falls_silent()) << logs();
  far.host.emplace(
      network_->start(1, {"takt-policy-host", "--robot", robot_file(), "--runtime-dir", far.directory}, log("far")));
  EXPECT_TRUE(moves_on()) << logs();
  far.server.reset();
  EXPECT_TRUE(falls_silent()) << logs();
  far.server.emplace(network_->start(
      1, {"takt-policy-server", "--robot", robot_file(), "--runtime-dir", far.directory, "--name", "far"}, log("far")));
  EXPECT_TRUE(moves_on()) << logs();
}

TEST_F(RemotePolicy, AnExecutiveThatRestartsIsANewSession) {
  const FarMachine far = start_far("far");
  ASSERT_TRUE(moves_on(40)) << logs();
  EXPECT_EQ(robot_->violation(), "");
  robot_.reset();
  robot_ =
      std::make_unique<Robot>(directory(), config_, *camera_);  // its ids begin at 1, and it knows of nothing before
  EXPECT_TRUE(moves_on()) << logs();
}

TEST_F(RemotePolicy, AnotherServerTakesOverFromASilentOneAndKeepsTheLead) {
  FarMachine first = start_far("first");
  ASSERT_TRUE(moves_on()) << logs();
  FarMachine second = start_far("second");
  ASSERT_TRUE(is_said("second", "policy attached")) << logs();
  ASSERT_TRUE(moves_on()) << logs();
  EXPECT_EQ(text_of(log("bridge")).find("takes over"), std::string::npos) << logs();
  first.server->signal(SIGSTOP);
  const std::uint64_t first_of_second = robot_->sequence() + 1;
  EXPECT_TRUE(is_said("bridge", "policy server first is silent: second takes over")) << logs();
  EXPECT_TRUE(until([&] { return std::string(robot_->source().sentence).starts_with("policy server second ("); }));
  EXPECT_GE(robot_->source().first_sequence, first_of_second);
  EXPECT_TRUE(moves_on()) << logs();
  first.server->signal(SIGCONT);
  EXPECT_TRUE(moves_on(40)) << logs();
  EXPECT_EQ(text_of(log("bridge")).find("second is silent"), std::string::npos) << "the lead stays";
}

TEST_F(RemotePolicy, NeitherMachineKnowsTheOthersClock) {
  // Eleven days further on, by CLOCK_MONOTONIC.
  const std::vector<std::string> elsewhere{"/usr/bin/unshare", "--time", "--monotonic",
                                           "1000000",          "--fork", "--kill-child=SIGKILL"};
  const FarMachine far = start_far("far", elsewhere);
  EXPECT_TRUE(moves_on()) << logs();
}

TEST_F(RemotePolicy, AServerWithAnotherRobotFileMovesNothingAndSaysSo) {
  const std::string other = temporary_.path("other.yaml");
  std::ofstream(other) << replaced(robot_text(), "stop_after: 3 s", "stop_after: 4 s");
  const FarMachine far = start_far("far", {}, other);
  EXPECT_TRUE(is_said("far", "its robot file differs from this one there; use the same")) << logs();
  EXPECT_EQ(robot_->commands(), 0U);
}

TEST_F(RemotePolicy, TwoRobotsOfOneMachineAreServedApart) {
  const FarMachine far = start_far("far");
  ASSERT_TRUE(moves_on()) << logs();
  // Another robot, on the same network: its bridge hears none, and none is disturbed.
  const std::string file = temporary_.path("another.yaml"), directory = temporary_.path("another");
  std::ofstream(file) << replaced(robot_text(), "robot: arm6", "robot: another");
  std::filesystem::create_directories(directory);
  Camera its_camera(directory);
  Robot another(directory, config::load(file).value(), its_camera);
  const Child bridge =
      network_->start(0, {"takt-policy-bridge", "--robot", file, "--runtime-dir", directory}, log("another"));
  ASSERT_TRUE(is_said("another", "attached to"));
  EXPECT_TRUE(moves_on(60)) << logs();
  EXPECT_EQ(another.commands(), 0U);
  const FarMachine its_own = start_far("far_of_another", {}, file);
  EXPECT_TRUE(until([&] { return another.commands() > 20; })) << logs();
  EXPECT_EQ(another.violation(), "") << logs();
  EXPECT_TRUE(moves_on()) << logs();
}

// Goal: the robot is told which part failed when its policy is silent, and that it is over; and whose commands it
// plays. Method: each part of the way is stopped in turn.
TEST_F(RemotePolicy, ThePartThatFailedIsNamed) {
  EXPECT_TRUE(until([&] { return robot_->problem().starts_with("no policy server is in the DDS domain"); }))
      << robot_->problem();
  FarMachine far = start_far("far");
  ASSERT_TRUE(moves_on()) << logs();
  EXPECT_TRUE(until([&] { return robot_->problem().empty(); })) << robot_->problem();
  EXPECT_EQ(std::string(robot_->source().sentence).find("policy server far ("), 0U) << robot_->source().sentence;
  EXPECT_EQ(robot_->source().first_sequence, 1U);
  const auto is_told = [&](const std::string& problem) {
    return until([&] { return robot_->problem().starts_with(problem); });
  };
  far.host->signal(SIGSTOP);
  EXPECT_TRUE(is_told("policy server far hears this robot, and its policy does not answer")) << robot_->problem();
  far.host->signal(SIGCONT);
  EXPECT_TRUE(until([&] { return robot_->problem().empty(); })) << robot_->problem();
  far.host.reset();
  EXPECT_TRUE(is_told("policy server far has no policy")) << robot_->problem();
  far.host.emplace(
      network_->start(1, {"takt-policy-host", "--robot", robot_file(), "--runtime-dir", far.directory}, log("far")));
  EXPECT_TRUE(moves_on()) << logs();
  network_->set({.delay = {}, .jitter = {}, .loss = 0, .twice = 0, .is_cut = true});
  EXPECT_TRUE(is_told("policy server far is not heard, nor is its machine: the network")) << robot_->problem();
  network_->set({});
  EXPECT_TRUE(moves_on()) << logs();
  far.server->signal(SIGKILL);
  EXPECT_TRUE(is_told("policy server far is not heard, and its machine answers: takt-policy-server ended"))
      << robot_->problem();
}

// Goal: no message of a stranger silences a server, or makes its policy forget. Method: remote_stranger, on the
// policy's machine, beside a robot that moves.
// Threat: policy-stranger
TEST_F(RemotePolicy, AStrangersMessagesSilenceNoServer) {
  const FarMachine far = start_far("far");
  ASSERT_TRUE(moves_on()) << logs();
  for (const std::string how : {"observations", "sessions", "answers"}) {
    const std::string name = "stranger_" + how;
    const Child stranger =
        network_->start(1, {std::string(TAKT_BIN_DIR) + "/remote_stranger", robot_file(), how}, log(name));
    EXPECT_TRUE(is_said(name, "sent")) << how << '\n' << logs();
    EXPECT_TRUE(moves_on(40)) << how << '\n' << logs();
  }
  EXPECT_EQ(occurrences(text_of(log("far")), "begins a session"), 1U) << logs();
  EXPECT_TRUE(is_said("far", "two processes show observations of robot arm6")) << logs();
  EXPECT_TRUE(is_said("bridge", "under another server's number")) << logs();
}

// Goal: of two robots of one name a server serves the one that came first, until that one is silent; the other is not
// moved. Method: a second executive and bridge of the same robot file beside the first, whose bridge is killed then.
TEST_F(RemotePolicy, ANamesakeIsNotMovedByAServerThatServesAnother) {
  const FarMachine far = start_far("far");
  ASSERT_TRUE(moves_on()) << logs();
  const std::string directory = temporary_.path("namesake");
  std::filesystem::create_directories(directory);
  Camera its_camera(directory);
  Robot namesake(directory, config_, its_camera);
  const Child bridge =
      network_->start(0, {"takt-policy-bridge", "--robot", robot_file(), "--runtime-dir", directory}, log("namesake"));
  EXPECT_TRUE(is_said("far", "two processes show observations of robot arm6")) << logs();
  EXPECT_TRUE(moves_on(60)) << logs();
  EXPECT_EQ(namesake.commands(), 0U);
  EXPECT_EQ(occurrences(text_of(log("far")), "begins a session"), 1U) << logs();
  bridge_->signal(SIGSTOP);
  EXPECT_TRUE(until([&] { return namesake.commands() > 20; })) << logs();
  EXPECT_EQ(namesake.violation(), "") << logs();
  EXPECT_EQ(occurrences(text_of(log("far")), "begins a session"), 2U) << logs();
  bridge_->signal(SIGCONT);
}

// Goal: with dds.security a robot and a policy server that have certificates of one authority talk; a stranger who has
// none, or another authority's, is not heard, though what it says would be believed without. Method: keys as
// docs/ros2.md has them made; the policy's machine has its own in the folder of the same name.
class RemotePolicySecured : public RemotePolicy {
 protected:
  void SetUp() override {
    if (!FaultyNetwork::why_not().empty()) return RemotePolicy::SetUp();
    for (const std::string authority : {"ours", "theirs"}) {
      Child made({std::filesystem::current_path() / "docs/examples/dds-security/make-keys.sh",
                  temporary_.path(authority), "0", "robot", "gpu"},
                 log("keys"));
      ASSERT_EQ(made.wait(std::chrono::seconds(30)), 0) << text_of(log("keys"));
    }
    RemotePolicy::SetUp();
  }
  [[nodiscard]] std::string keys() const { return temporary_.path("ours") + "/robot"; }
  [[nodiscard]] std::string robot_text() const override {
    return replaced(RemotePolicy::robot_text(), "dds: { ", "dds: { security: " + keys() + ", ");
  }
  // Words that give a program `folder` for its keys.
  [[nodiscard]] std::vector<std::string> having(const std::string& folder) const {
    return {"/usr/bin/unshare", "--mount", "sh", "-c", R"(mount --bind "$0" )" + keys() + R"( && exec "$@")", folder};
  }
  [[nodiscard]] Child start_stranger() const {
    return network_->start(1, {std::string(TAKT_BIN_DIR) + "/remote_stranger", robot_file(), "blind"}, log("stranger"));
  }
  // For 2 s the robot does not know of any server.
  void expect_unheard() {
    const std::uint64_t shown = robot_->shown();
    ASSERT_TRUE(until([&] { return robot_->shown() > shown + 100; }));
    EXPECT_TRUE(robot_->problem().starts_with("no policy server is in the DDS domain")) << robot_->problem() << logs();
    EXPECT_EQ(robot_->commands(), 0U);
  }
};

// Threat: dds-certificate
TEST_F(RemotePolicySecured, AStrangerWithoutACertificateIsNotHeard) {
  ASSERT_TRUE(until([&] { return !robot_->problem().empty(); })) << logs();
  const Child stranger = start_stranger();
  ASSERT_TRUE(is_said("stranger", "sent")) << logs();
  ASSERT_NO_FATAL_FAILURE(expect_unheard());
  const FarMachine far = start_far("far", having(temporary_.path("ours") + "/gpu"));
  EXPECT_TRUE(moves_on()) << logs();
  EXPECT_EQ(std::string(robot_->source().sentence).find("policy server far ("), 0U) << robot_->source().sentence;
}

TEST_F(RemotePolicySecured, AServerOfAnotherAuthorityIsNotHeard) {
  ASSERT_TRUE(until([&] { return !robot_->problem().empty(); })) << logs();
  const FarMachine far = start_far("far", having(temporary_.path("theirs") + "/gpu"));
  ASSERT_TRUE(is_said("far", "policy attached")) << logs();
  ASSERT_NO_FATAL_FAILURE(expect_unheard());
}

TEST_F(RemotePolicySecured, WithoutItsFilesNoProgramJoinsTheDomain) {
  const FarMachine far = start_far("far", having(temporary_.path("ours") + "/ca"));
  EXPECT_TRUE(is_said("far", "/identity_ca.cert.pem: No such file or directory; docs/ros2.md says how to make it"))
      << logs();
  EXPECT_TRUE(until([&] { return robot_->problem().starts_with("no policy server is in the DDS domain"); }))
      << robot_->problem() << logs();
}

// What is not heard there is heard here: the stranger is one that can be.
TEST_F(RemotePolicy, AStrangerIsHeardWithoutSecurity) {
  const Child stranger =
      network_->start(1, {std::string(TAKT_BIN_DIR) + "/remote_stranger", robot_file(), "blind"}, log("stranger"));
  EXPECT_TRUE(until([&] { return robot_->problem().starts_with("policy server stranger has no policy"); }))
      << robot_->problem() << logs();
}

// A policy through the C library, on the other machine.
class RemoteClient : public RemotePolicy {
 protected:
  void TearDown() override {
    takt_policy_close(policy_);
    RemotePolicy::TearDown();
  }
  // The robot file's target of three values comes after `terms`.
  void attach(std::vector<takt_term> terms) {
    terms.push_back({TAKT_TERM_STREAM, 3, "target", nullptr, nullptr});
    const std::string far = temporary_.path("far"), file = robot_file();
    std::filesystem::create_directories(far);
    server_.emplace(network_->start(1, {"takt-policy-server", "--robot", file, "--runtime-dir", far}, log("far")));
    takt_policy_spec spec{};
    spec.size = sizeof spec;
    spec.term_count = static_cast<std::uint32_t>(terms.size());
    spec.terms = terms.data();
    spec.robot_file = file.c_str();
    spec.runtime_directory = far.c_str();
    spec.program = "remote_policy_test";
    spec.step = "10 ms";
    spec.steps = 16;
    std::array<char, 512> why{};
    ASSERT_EQ(takt_policy_open(&spec, &policy_, why.data(), why.size()), TAKT_OK) << why.data();
  }
  void publish(const takt_assumption* assumes = nullptr) {
    const std::vector<float> q(std::size_t{16} * 6, 0.1F);
    takt_chunk chunk{};
    chunk.size = sizeof chunk;
    chunk.q = q.data();
    chunk.assumes = assumes;
    EXPECT_EQ(takt_policy_publish(policy_, &chunk), TAKT_OK) << takt_policy_sentence(policy_);
  }

  std::optional<Child> server_;
  takt_policy* policy_ = nullptr;
};

// Every vector of the observation has values of its own there; none is left at zero.
TEST_F(RemoteClient, IsShownEveryVectorOfAnObservation) {
  const std::array<takt_term, 5> terms{{{TAKT_TERM_Q, 0, nullptr, nullptr, nullptr},
                                        {TAKT_TERM_DQ, 0, nullptr, nullptr, nullptr},
                                        {TAKT_TERM_TAU, 0, nullptr, nullptr, nullptr},
                                        {TAKT_TERM_Q_SETPOINT, 0, nullptr, nullptr, nullptr},
                                        {TAKT_TERM_DQ_OF_DRIVE, 0, nullptr, nullptr, nullptr}}};
  ASSERT_NO_FATAL_FAILURE(attach({terms.begin(), terms.end()}));
  ASSERT_TRUE(until([&] { return takt_policy_next(policy_, 100'000'000) == TAKT_OK; })) << logs();
  const takt_observation& observation = *takt_policy_observation(policy_);
  for (std::size_t term = 0; term < terms.size(); ++term)
    for (std::size_t j = 0; j < 6; ++j)
      EXPECT_EQ(observation.values[6 * term + j], observed(static_cast<int>(terms[term].kind), j))
          << "term " << term << " joint " << j;
}

// Goal: what a policy on the other machine says of itself reaches the robot: why it publishes nothing, and whose
// commands it plays. Method: as a client of an openpi server says it.
TEST_F(RemoteClient, SaysWhyItPublishesNothingAndWhoseCommandsItPlays) {
  ASSERT_NO_FATAL_FAILURE(attach({{TAKT_TERM_Q, 0, nullptr, nullptr, nullptr}}));
  const auto publish_of = [&](const std::string& source, std::uint64_t commands) {
    ASSERT_EQ(takt_policy_state_source(policy_, source.c_str()), TAKT_OK);
    const std::uint64_t before = robot_->commands();
    EXPECT_TRUE(until([&] {
      if (takt_policy_next(policy_, 100'000'000) == TAKT_OK) publish();
      return robot_->commands() >= before + commands;
    })) << logs();
  };
  const auto is_source = [&](const std::string& words) {
    const std::string sentence = robot_->source().sentence;
    return sentence.starts_with("policy server ") && sentence.ends_with(words);
  };
  publish_of("ws://gpu1:8000, metadata 0123456789abcdef", 10);
  EXPECT_TRUE(until([&] { return is_source("): ws://gpu1:8000, metadata 0123456789abcdef"); }))
      << robot_->source().sentence;
  EXPECT_EQ(robot_->source().first_sequence, 1U);
  const std::uint64_t sequence = robot_->sequence();
  publish_of("ws://gpu2:8000", 10);
  EXPECT_TRUE(until([&] { return is_source("): ws://gpu2:8000"); })) << robot_->source().sentence;
  EXPECT_GT(robot_->source().first_sequence, sequence);
  ASSERT_EQ(takt_policy_state_problem(policy_, "ws://gpu2:8000 closed the connection"), TAKT_OK);
  EXPECT_TRUE(until([&] {
    takt_policy_next(policy_, 10'000'000);
    return robot_->problem().ends_with("its policy says: ws://gpu2:8000 closed the connection");
  })) << robot_->problem();
}

// Alternatives wait on the policy's machine; the one that matches is sent, as old as what it rests on.
class RemoteSpeculation : public RemoteClient {
 protected:
  [[nodiscard]] std::string robot_text() const override {
    return replaced(RemotePolicy::robot_text(), "  steps: 16\n",
                    "  steps: 16\n  speculation: { position: 0.05 rad, velocity: 0.5 rad/s }\n");
  }
};

TEST_F(RemoteSpeculation, WhatCameTrueArrivesNoYoungerThanItIs) {
  ASSERT_NO_FATAL_FAILURE(attach({{TAKT_TERM_Q, 0, nullptr, nullptr, nullptr}}));
  std::array<float, 6> q{};
  for (std::size_t j = 0; j < q.size(); ++j) q[j] = observed(TAKT_TERM_Q, j);
  robot_->speculates();
  EXPECT_TRUE(until([&] {
    if (takt_policy_next(policy_, 100'000'000) != TAKT_OK) return false;
    const std::int64_t ahead = takt_policy_observation(policy_)->published_ns + 30'000'000;
    const takt_assumption assumes{sizeof assumes, 0, ahead, q.data(), nullptr};
    publish(&assumes);
    return robot_->commands() > 10;
  })) << takt_policy_sentence(policy_)
      << '\n'
      << logs();
  EXPECT_GT(takt_policy_alternatives(policy_)->taken, 10U);
  EXPECT_EQ(robot_->violation(), "") << logs();
}

// A sensor as wide as they come, and a camera.
class RemoteImages : public RemoteClient {
 protected:
  static constexpr std::uint32_t kHeight = 480, kWidth = 640, kChannels = 3, kScan = 256;
  [[nodiscard]] std::string robot_text() const override {
    std::string text =
        replaced(RemotePolicy::robot_text(), "\nsensors:\n",
                 "\nsensors:\n  - { name: cam0, image: { height: 480, width: 640, channels: 3 }, timeout: 5 s }\n"
                 "  - { name: scan, values: 256, timeout: 5 s }\n");
    text.insert(text.find('\n', text.find("\n  observation:") + 1) + 1,
                "    - { term: sensor, sensor: cam0 }\n    - { term: sensor, sensor: scan }\n");
    return text;
  }
  // A picture of number `n`, every byte of which says so.
  static std::uint8_t pixel(std::uint8_t n, std::size_t i) { return static_cast<std::uint8_t>(n + 7 * i); }
  takt_sensor* open(takt_sensor_spec spec) const {
    const std::string file = robot_file(), runtime = directory();
    spec.size = sizeof spec;
    spec.robot_file = file.c_str();
    spec.runtime_directory = runtime.c_str();
    takt_sensor* sensor = nullptr;
    std::array<char, 512> why{};
    EXPECT_EQ(takt_sensor_open(&spec, &sensor, why.data(), why.size()), TAKT_OK) << why.data();
    return sensor;
  }
  void film(const std::stop_token& stop) {
    takt_sensor_spec camera{}, scanner{};
    camera.name = "cam0";
    camera.type = TAKT_UINT8;
    camera.height = kHeight;
    camera.width = kWidth;
    camera.channels = kChannels;
    scanner.name = "scan";
    scanner.type = TAKT_FLOAT32;
    scanner.values = kScan;
    takt_sensor *const cam0 = open(camera), *const scan = open(scanner);
    ASSERT_TRUE(cam0 != nullptr && scan != nullptr);
    for (std::uint8_t n = 0; !stop.stop_requested(); ++n) {
      auto* const pixels = static_cast<std::uint8_t*>(takt_sensor_values(cam0));
      for (std::size_t i = 0; i < std::size_t{kHeight} * kWidth * kChannels; ++i) pixels[i] = pixel(n, i);
      auto* const heights = static_cast<float*>(takt_sensor_values(scan));
      for (std::size_t i = 0; i < kScan; ++i) heights[i] = static_cast<float>(i);
      const MonoTime sensed = monotonic_now() - milliseconds(5);
      camera_->remember(sensed);
      EXPECT_EQ(takt_sensor_publish(cam0, sensed.ns), TAKT_OK);
      EXPECT_EQ(takt_sensor_publish(scan, sensed.ns), TAKT_OK);
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    takt_sensor_close(cam0);
    takt_sensor_close(scan);
  }
};

TEST_F(RemoteImages, CrossWholeWithTheAgeThatTheyHave) {
  const std::jthread filming([this](const std::stop_token& stop) { film(stop); });
  ASSERT_NO_FATAL_FAILURE(attach({{TAKT_TERM_Q, 0, nullptr, nullptr, nullptr},
                                  {TAKT_TERM_STREAM, kScan, "scan", nullptr, nullptr},
                                  {TAKT_TERM_IMAGE, 0, "cam0", nullptr, nullptr}}));
  network_->set({.delay = milliseconds(2), .jitter = milliseconds(2), .loss = 0.01, .twice = 0.01});
  std::set<std::uint8_t> pictures;
  EXPECT_TRUE(until([&] {
    if (takt_policy_next(policy_, 100'000'000) != TAKT_OK) return false;
    const takt_observation& observation = *takt_policy_observation(policy_);
    for (std::size_t i = 0; i < kScan; ++i) EXPECT_EQ(observation.values[6 + i], static_cast<float>(i));
    const std::uint8_t* const seen = observation.images[0];
    for (std::size_t i = 0; i < std::size_t{kHeight} * kWidth * kChannels; ++i)
      if (seen[i] != pixel(seen[0], i)) {
        ADD_FAILURE() << "byte " << i << " is another picture's";
        return true;
      }
    pictures.insert(seen[0]);
    publish();
    return pictures.size() >= 10 && robot_->commands() >= 10;
  })) << pictures.size()
      << " pictures; " << takt_policy_sentence(policy_) << '\n'
      << logs();
}

}  // namespace
}  // namespace takt::test
