// SPDX-License-Identifier: Apache-2.0
// Goal: a policy on another machine answers what it would answer beside the executive, bit for bit: observations,
// samples and a network's memory cross, and nothing of them is lost or rounded. Method: takt-policy-host as a real
// process, once at the executive's own socket, once behind takt-policy-bridge and takt-policy-server in another network
// namespace; the test is executive and sensor, asks the same questions one after the other, and compares the values of
// the answers. Every question differs from the one before in every vector, and each answer depends on those before.
// What the last action was depends on when the next observation is: questions are stamped a second apart, which is
// longer than a chunk, all of them in the past, so that no process has to wait for them and no network's delay matters.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "tests/policy_host/demo_arm_networks.hpp"
#include "tests/policy_host/fake_server.hpp"
#include "tests/process/child.hpp"
#include "tests/process/faulty_network.hpp"
#include "tests/process/patient_copy.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::test {
namespace {

using policy_host::FakeExecutive;
using policy_host::FakeSensor;

constexpr int kQuestions = 20;
constexpr Duration kApart = seconds(1);

// One executive and its camera, that ask.
class Asker {
 public:
  Asker(const std::string& directory, std::uint32_t joints)
      : joints_(joints),
        executive_(config::executive_socket(directory)),
        camera_(config::sensor_socket(directory, "target")) {}

  // The answers' values, to kQuestions questions after the policy was told to forget; fewer: one was not answered.
  std::vector<std::vector<float>> answers() {
    std::vector<std::vector<float>> found;
    if (!until_answered([this] { return publish(-1, Mode::standby); })) return found;
    for (int question = 0; question < kQuestions; ++question) {
      const std::uint64_t id = publish(question, question == 0 ? Mode::arming : Mode::tracking);
      if (!until_answered([id] { return id; })) break;
      found.emplace_back(chunk_.values, chunk_.values + chunk_.value_count());
    }
    return found;
  }

 private:
  std::uint64_t publish(int question, Mode mode) {
    const auto at = [question](int vector, std::size_t j) {
      return static_cast<float>(0.4 * std::sin(0.37 * question + 1.3 * vector + 0.7 * static_cast<double>(j)));
    };
    SensorSample sample;
    sample.published_at = monotonic_now();
    sample.sensed_at = sample.published_at - milliseconds(3);
    sample.value_count = 3;
    for (std::size_t j = 0; j < 3; ++j) sample.values[j] = at(9, j);
    sample.sequence = ++samples_;
    camera_.publish(sample);
    Observation observation;
    observation.id = ++id_;
    observation.tick = id_ * 20;
    observation.published_at = first_ + kApart * question;
    observation.oldest_sensed_at = observation.published_at - milliseconds(1);
    observation.period = milliseconds(40);
    observation.joint_count = joints_;
    observation.mode = static_cast<std::uint8_t>(mode);
    for (std::size_t j = 0; j < joints_; ++j) {
      observation.q[j] = at(0, j);
      observation.dq[j] = at(1, j);
      observation.tau[j] = at(2, j);
      observation.q_setpoint[j] = at(3, j);
      observation.dq_of_drive[j] = at(4, j);
    }
    executive_.publish(observation);
    return id_;
  }
  // Asks until the newest question is answered. Bounded: 30 s.
  bool until_answered(const std::function<std::uint64_t()>& ask) {
    for (int round = 0; round < 600; ++round) {
      const std::uint64_t id = ask();
      for (int poll = 0; poll < 50; ++poll) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        if (executive_.acknowledged() && executive_.read(chunk_) && chunk_.header.observation_id == id) return true;
      }
    }
    return false;
  }

  std::uint32_t joints_;
  MonoTime first_ = monotonic_now() - kApart * (kQuestions + 1);
  FakeExecutive executive_;
  FakeSensor camera_;
  CommandChunk chunk_;
  std::uint64_t id_ = 0, samples_ = 0;
};

class RemotePolicyValues : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string why = FaultyNetwork::why_not(); !why.empty())
      GTEST_SKIP() << "NO POLICY ON ANOTHER MACHINE WAS TESTED: " << why;
  }
  void expect_the_same(const std::string& policy_file) {
    const std::string robot_file = patient_copy("config/arm6.yaml", temporary_.path(),
                                                {{"policy.file", policy_file},
                                                 {"policy.period", "40 ms"},  // as many as max_age holds are remembered
                                                 {"freshness.max_age", "60 s"},
                                                 {"freshness.stop_after", "120 s"},
                                                 {"record.policy_inputs", "false"}});
    ASSERT_EQ(robot_file, robot_);
    std::ofstream(robot_, std::ios::app)
        << "\ndds: { interface: takt0, peers: [{ address: 10.77.0.1 }, { address: 10.77.0.2 }] }\n";
    const auto robot = config::load(robot_);
    ASSERT_TRUE(robot) << robot.error();
    const auto beside = beside_the_executive(robot->joints.size());
    const auto far = on_another_machine(robot->joints.size());
    ASSERT_EQ(beside.size(), std::size_t{kQuestions}) << text_of(log_);
    ASSERT_EQ(far.size(), std::size_t{kQuestions}) << text_of(log_);
    EXPECT_NE(beside.front(), beside.back());
    for (std::size_t i = 0; i < beside.size(); ++i) EXPECT_EQ(beside[i], far[i]) << "answer " << i;
  }
  std::vector<std::vector<float>> beside_the_executive(std::size_t joints) {
    const std::string directory = made("beside");
    Asker asker(directory, static_cast<std::uint32_t>(joints));
    const Child host({"takt-policy-host", "--robot", robot_, "--runtime-dir", directory}, log_);
    return asker.answers();
  }
  std::vector<std::vector<float>> on_another_machine(std::size_t joints) {
    const FaultyNetwork network;
    const std::string directory = made("robot"), far = made("far");
    Asker asker(directory, static_cast<std::uint32_t>(joints));
    const auto start = [&](int side, const char* program, const std::string& where) {
      return network.start(side, {program, "--robot", robot_, "--runtime-dir", where}, log_);
    };
    const Child bridge = start(0, "takt-policy-bridge", directory), server = start(1, "takt-policy-server", far),
                host = start(1, "takt-policy-host", far);
    return asker.answers();
  }
  [[nodiscard]] std::string made(const std::string& name) const {
    std::filesystem::create_directories(temporary_.path(name));
    return temporary_.path(name);
  }

  TemporaryDirectory temporary_;
  std::string robot_ = temporary_.path("arm6.yaml"), log_ = temporary_.path("log");
};

TEST_F(RemotePolicyValues, OfANetworkThatSeesItsLastAction) {
  expect_the_same((std::filesystem::current_path() / "config/arm6_reach.onnx").string());
}

TEST_F(RemotePolicyValues, OfARecurrentNetwork) {
  // h_out = 0.9 h_in + obs, actions = h_out w: every observation since the reset is in every answer.
  auto maker = policy_host::demo_arm_network();
  maker.input("h_in", {1, 24}).output("h_out");
  maker.floats("w", {24, 96}, policy_host::some_weights(std::size_t{24} * 96)).floats("share", {1}, {0.9F});
  maker.node("Mul", {"h_in", "share"}, {"kept"});
  maker.node("Add", {"kept", "obs"}, {"h_out"});
  maker.node("MatMul", {"h_out", "w"}, {"actions"});
  const std::string file = temporary_.path("recurrent.onnx");
  policy_host::write(maker, file);
  expect_the_same(file);
}

}  // namespace
}  // namespace takt::test
