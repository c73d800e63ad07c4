// SPDX-License-Identifier: Apache-2.0
// Goal: the host finds the executive and the sensor in any order of starting, answers observations, is silent without
// its sensor, and attaches again after the executive went away. Method: the real host in a thread, over real sockets
// and mailboxes; the test publishes observations until what it waits for happens, and fails only after a long limit.
#include "policy_host/host.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <functional>
#include <memory>
#include <thread>

#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "tests/policy_host/fake_server.hpp"
#include "tests/policy_host/scripted_policy.hpp"
#include "tests/policy_host/small_robot.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host {
namespace {

constexpr Duration kLimit = seconds(30);

config::RobotConfig hashed_robot() {
  auto robot = small_robot();
  robot.hash = 42;
  return robot;
}

class HostTest : public testing::Test {
 protected:
  explicit HostTest(std::vector<HostFaultWindow> faults = {}, config::RobotConfig robot = hashed_robot())
      : robot_(std::move(robot)),
        policy_(10, 12),
        host_(robot_, directory_.path(), 0xABCD, engines_, HostFaults(std::move(faults), 1)) {}
  ~HostTest() override { end(); }

  void start() {
    thread_ = std::thread([this] { host_.run(stop_); });
  }
  void end() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  std::unique_ptr<FakeExecutive> start_executive() {
    return std::make_unique<FakeExecutive>(config::executive_socket(directory_.path()), largest_input_);
  }
  std::unique_ptr<FakeSensor> start_sensor() {
    return std::make_unique<FakeSensor>(config::sensor_socket(directory_.path(), "eye"));
  }
  static bool wait_for(const std::function<bool()>& holds) {
    const MonoTime give_up = monotonic_now() + kLimit;
    while (monotonic_now() < give_up) {
      if (holds()) return true;
      sleep_until(monotonic_now() + milliseconds(5));
    }
    return false;
  }
  // Publishes observations, and samples when there is a sensor, until a command comes back.
  bool exchange(FakeExecutive& executive, FakeSensor* sensor, CommandChunk& chunk) {
    return wait_for([&] {
      publish(executive, sensor);
      return executive.read(chunk);
    });
  }
  void publish(FakeExecutive& executive, FakeSensor* sensor) {
    if (sensor != nullptr) {
      auto sample = small_sample(++sample_sequence_, 1, 2);
      sample.sensed_at = monotonic_now();
      sensor->publish(sample);
    }
    auto observation = small_observation(++observation_id_);
    observation.published_at = monotonic_now();
    observation.mode = static_cast<std::uint8_t>(Mode::tracking);
    executive.publish(observation);
  }

  test::TemporaryDirectory directory_;
  config::RobotConfig robot_;
  std::size_t largest_input_ = config::largest_policy_input(robot_);
  ScriptedPolicy policy_;
  std::array<Policy*, 1> engines_{&policy_};
  Host host_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
  std::uint64_t observation_id_ = 0;
  std::uint64_t sample_sequence_ = 0;
};

TEST_F(HostTest, AnswersOnceExecutiveAndSensorAreThere) {
  start();
  const auto executive = start_executive();
  ASSERT_TRUE(wait_for([&] { return executive->acknowledged(); }));
  EXPECT_EQ(executive->hello().role, Role::policy);
  EXPECT_EQ(executive->hello().config_hash, 42U);
  EXPECT_EQ(executive->hello().policy_hash, 0xABCDU);
  EXPECT_EQ(executive->hello().joint_names_hash, config::joint_names_hash(robot_));
  EXPECT_EQ(executive->hello().joint_count, 3U);
  EXPECT_EQ(executive->hello().step_count, 4U);
  const auto sensor = start_sensor();
  CommandChunk chunk;
  ASSERT_TRUE(exchange(*executive, sensor.get(), chunk));
  EXPECT_EQ(chunk.header.policy_hash, 0xABCDU);
  EXPECT_GE(chunk.header.observation_id, 1U);
  EXPECT_LE(chunk.header.observation_id, observation_id_);
  EXPECT_TRUE(chunk.header.outside_sensed_at.is_set());
  EXPECT_LE(chunk.header.dequeued_at, chunk.header.infer_started_at);
  EXPECT_LE(chunk.header.infer_started_at, chunk.header.infer_ended_at);
  EXPECT_LE(chunk.header.infer_ended_at, chunk.header.published_at);
  EXPECT_FLOAT_EQ(chunk.values[0], 1.0F + static_cast<float>(chunk.header.sequence)) << "home plus the policy's output";
}

TEST_F(HostTest, IsSilentWithoutItsSensor) {
  const auto executive = start_executive();
  start();
  ASSERT_TRUE(wait_for([&] { return executive->acknowledged(); }));
  CommandChunk chunk;
  for (int i = 0; i < 20; ++i) {
    publish(*executive, nullptr);
    sleep_until(monotonic_now() + milliseconds(20));
  }
  EXPECT_FALSE(executive->read(chunk));
  end();
  EXPECT_EQ(policy_.calls, 0) << "no inference on half an input";
}

TEST_F(HostTest, AttachesAgainWithAFreshSession) {
  start();
  const auto sensor = start_sensor();
  auto executive = start_executive();
  ASSERT_TRUE(wait_for([&] { return executive->acknowledged(); }));
  CommandChunk chunk;
  ASSERT_TRUE(exchange(*executive, sensor.get(), chunk));
  ASSERT_TRUE(exchange(*executive, sensor.get(), chunk));
  EXPECT_GE(chunk.header.sequence, 2U);
  executive.reset();
  executive = start_executive();
  ASSERT_TRUE(wait_for([&] { return executive->acknowledged(); }));
  observation_id_ = 0;
  ASSERT_TRUE(exchange(*executive, sensor.get(), chunk));
  EXPECT_LE(chunk.header.sequence, observation_id_) << "counted from 1 again";
}

// Goal: beside every command goes what it was made from. Method: the newest payload of the input ring against the
// newest command, by the layout that the contract states.
TEST_F(HostTest, PublishesWhatItsPolicyWasShownAndSaid) {
  start();
  const auto sensor = start_sensor();
  const auto executive = start_executive();
  ASSERT_TRUE(wait_for([&] { return executive->acknowledged(); }));
  CommandChunk chunk;
  ASSERT_TRUE(exchange(*executive, sensor.get(), chunk));
  ASSERT_TRUE(exchange(*executive, sensor.get(), chunk));
  const ipc::Segment segment = executive->inputs(largest_input_);
  auto reader = must(ipc::SlotReader::attach(segment.readable(), ipc::policy_input_ring(largest_input_)));
  std::vector<std::byte> payload(largest_input_);
  ipc::ReadResult read;
  PolicyInputHeader header;
  ASSERT_TRUE(wait_for([&] {  // it comes behind its command
    read = reader.read_next(payload);
    if (read.status != ipc::ReadStatus::fresh) return false;
    std::memcpy(&header, payload.data(), sizeof header);
    return header.sequence == chunk.header.sequence;
  }));
  EXPECT_EQ(header.observation_id, chunk.header.observation_id);
  EXPECT_EQ(header.policy_hash, 0xABCDU);
  EXPECT_EQ(header.inference, header.sequence) << "one session";
  EXPECT_EQ(header.built_in, 0) << "a scripted policy is no engine of Takt's";
  EXPECT_EQ(read.size, policy_input_bytes(1, 3 + 2 + 10 + 12)) << "joints, sensor, input, output";
}

// Goal: a robot file that records no inputs has a host that needs no ring. Method: an executive without one.
class UnrecordedHostTest : public HostTest {
 protected:
  static config::RobotConfig silent() {
    auto robot = hashed_robot();
    robot.record.policy_inputs = false;
    return robot;
  }
  UnrecordedHostTest() : HostTest({}, silent()) {}
};

TEST_F(UnrecordedHostTest, AnswersAllTheSame) {
  EXPECT_EQ(largest_input_, 0U);
  start();
  const auto sensor = start_sensor();
  const auto executive = start_executive();
  ASSERT_TRUE(wait_for([&] { return executive->acknowledged(); }));
  CommandChunk chunk;
  EXPECT_TRUE(exchange(*executive, sensor.get(), chunk));
}

class LateHostTest : public HostTest {
 protected:
  static constexpr Duration kLate = milliseconds(60);
  LateHostTest() : HostTest({{{}, seconds(1000), HostFault::publish_delay, static_cast<double>(kLate.ns)}}) {}
};

TEST_F(LateHostTest, PublishesLaterThanItsStampsSay) {
  start();
  const auto sensor = start_sensor();
  const auto executive = start_executive();
  ASSERT_TRUE(wait_for([&] { return executive->acknowledged(); }));
  CommandChunk chunk;
  std::uint64_t before = 0;
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(exchange(*executive, sensor.get(), chunk));
    EXPECT_GE(monotonic_now() - chunk.header.published_at, kLate);
    EXPECT_GT(chunk.header.sequence, before) << "in order";
    before = chunk.header.sequence;
  }
}

// Networks that wait: an inference ends when the test lets it.
class GatedPolicy final : public Policy {
 public:
  [[nodiscard]] std::size_t input_size() const override { return 10; }
  [[nodiscard]] std::size_t output_size() const override { return 12; }
  [[nodiscard]] bool is_recurrent() const override { return false; }
  void infer(std::span<const float> /*input*/, std::span<float> output) override {
    infers = true;
    while (!open) sleep_until(monotonic_now() + milliseconds(1));
    std::ranges::fill(output, 0.0F);
    infers = false;
    ++answers;
  }
  void reset() override {}
  std::atomic<bool> open = false, infers = false;
  std::atomic<int> answers = 0;
};

// Goal: two requests are in flight at once, the newer observation's answer goes out although the older one is not done,
// and the older one's never does. Method: two networks behind gates; the second opens first.
TEST(PipelinedHost, AnOlderAnswerNeverReplacesANewerOne) {
  test::TemporaryDirectory directory;
  auto robot = hashed_robot();
  robot.policy->requests_in_flight = 2;
  robot.policy->observation[1].sensor.clear();  // no sensor: it keeps its width as a constant
  robot.policy->observation[1].kind = config::TermKind::constant;
  robot.policy->observation[1].constant.assign(2, 0);
  robot.policy->observation[1].history = 2;
  GatedPolicy slow, fast;
  const std::array<Policy*, 2> engines{&slow, &fast};
  const std::size_t largest_input = config::largest_policy_input(robot);
  Host host(robot, directory.path(), 0xABCD, engines);
  std::atomic<bool> stop = false;
  std::thread thread([&] { host.run(stop); });
  auto executive = std::make_unique<FakeExecutive>(config::executive_socket(directory.path()), largest_input);
  const auto wait_for = [](const std::function<bool()>& holds) {
    const MonoTime give_up = monotonic_now() + kLimit;
    while (monotonic_now() < give_up) {
      if (holds()) return true;
      sleep_until(monotonic_now() + milliseconds(2));
    }
    return false;
  };
  EXPECT_TRUE(wait_for([&] { return executive->acknowledged(); }));
  std::uint64_t id = 0;
  const auto publish = [&] {
    auto observation = small_observation(++id);
    observation.published_at = monotonic_now();
    executive->publish(observation);
  };
  EXPECT_TRUE(wait_for([&] { return publish(), slow.infers && fast.infers; })) << "both at once";
  fast.open = true;
  CommandChunk chunk;
  EXPECT_TRUE(wait_for([&] { return executive->read(chunk); }));
  const std::uint64_t newer = chunk.header.observation_id;
  EXPECT_EQ(chunk.header.sequence, 2U) << "the first is still in the network";
  EXPECT_TRUE(slow.infers);
  fast.open = false;
  slow.open = true;
  EXPECT_TRUE(wait_for([&] { return slow.answers > 0; }));
  EXPECT_TRUE(wait_for([&] { return publish(), executive->read(chunk); })) << "the host goes on";
  EXPECT_GT(chunk.header.observation_id, newer);
  EXPECT_GT(chunk.header.sequence, 2U);
  fast.open = true;
  stop = true;
  thread.join();
}

}  // namespace
}  // namespace takt::policy_host
