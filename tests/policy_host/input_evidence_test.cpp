// Goal: what a network was shown and said leaves the host as it was, with the samples it was made from, and says when
// the network had forgotten its past. Method: the responder with a scripted policy; the packed bytes are taken apart
// here by the layout that the contract states.
#include "policy_host/input_evidence.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "config/observation_shape.hpp"
#include "tests/policy_host/scripted_policy.hpp"
#include "tests/policy_host/small_robot.hpp"

namespace takt::policy_host {
namespace {

MonoTime still_clock() {
  return MonoTime{} + seconds(5);
}

class InputEvidenceTest : public testing::Test {
 protected:
  InputEvidenceTest() : robot_(robot()), policy_(10, 12), responder_(robot_, 7, policy_), evidence_(robot_, 7, true) {}
  static config::RobotConfig robot() {
    auto robot = small_robot();
    robot.sensors.insert(robot.sensors.begin(), {.name = "idle", .values = 5, .timeout = milliseconds(1)});
    return robot;
  }
  std::span<const std::byte> answer(std::uint64_t id, float first) {
    samples_[1] = small_sample(id, first, 2);
    const Observation observation = small_observation(id);
    const CommandChunk& chunk = responder_.answer(observation, samples_, still_clock(), still_clock);
    return evidence_.pack(observation, samples_, chunk.header.sequence, responder_.inference());
  }
  static PolicyInputHeader header_of(std::span<const std::byte> payload) {
    PolicyInputHeader header;
    std::memcpy(&header, payload.data(), sizeof header);
    return header;
  }

  config::RobotConfig robot_;
  ScriptedPolicy policy_;
  Responder responder_;
  InputEvidence evidence_;
  std::vector<SensorSample> samples_ = std::vector<SensorSample>(2);
};

TEST_F(InputEvidenceTest, HoldsObservationSamplesInputAndOutputInOrder) {
  responder_.start_session();
  answer(40, 6);
  const auto payload = answer(41, 8);
  const PolicyInputHeader header = header_of(payload);
  EXPECT_EQ(header.observation_id, 41U);
  EXPECT_EQ(header.sequence, 2U);
  EXPECT_EQ(header.inference, 2U);
  EXPECT_EQ(header.policy_hash, 7U);
  EXPECT_EQ(header.joint_count, 3U);
  EXPECT_EQ(header.sensor_count, 1U) << "the idle sensor fed nothing";
  EXPECT_EQ(header.built_in, 1);
  ASSERT_EQ(payload.size(), policy_input_bytes(1, 3 + 2 + 10 + 12));
  PolicyInputSample sample;
  std::memcpy(&sample, payload.data() + sizeof header, sizeof sample);
  EXPECT_EQ(sample.sensor, 1U) << "by the robot file's order";
  EXPECT_EQ(sample.sequence, 41U);
  EXPECT_EQ(sample.sensed_at, MonoTime{} + milliseconds(30 * 41));
  EXPECT_EQ(sample.value_count, 2U);
  std::vector<float> values(3 + 2 + 10 + 12);
  std::memcpy(values.data(), payload.data() + sizeof header + sizeof sample, 4 * values.size());
  const std::vector<float> begin{1.5F, 2.5F, 3.5F, 8, 2};  // q, then the sample
  EXPECT_EQ(std::vector(values.begin(), values.begin() + 5), begin);
  EXPECT_EQ(std::vector(values.begin() + 5, values.begin() + 15), policy_.last_input);
  EXPECT_EQ(values[5 + 3], 6) << "history is part of the input, oldest first";
  EXPECT_EQ(values[15], 2.0F) << "the second call's first output, before scale and offset";
}

TEST_F(InputEvidenceTest, SaysWhenThePastWasForgotten) {
  responder_.start_session();
  EXPECT_EQ(header_of(answer(1, 0)).after_reset, 1);
  EXPECT_EQ(header_of(answer(2, 0)).after_reset, 0);
  EXPECT_EQ(header_of(answer(200, 0)).after_reset, 1) << "after a gap";
  policy_.broken = true;
  EXPECT_EQ(header_of(answer(201, 0)).after_reset, 0);
  policy_.broken = false;
  EXPECT_EQ(header_of(answer(202, 0)).after_reset, 1) << "after an output that was no number";
  responder_.start_session();
  const PolicyInputHeader header = header_of(answer(203, 0));
  EXPECT_EQ(header.after_reset, 1);
  EXPECT_EQ(header.sequence, 1U);
  EXPECT_EQ(header.inference, 6U) << "counted over the sessions of the host";
}

// Goal: what is announced as the largest payload is the largest, and robots whose inputs cannot be recorded say so.
TEST_F(InputEvidenceTest, TheLargestPayloadIsKnownFromTheRobotFile) {
  EXPECT_EQ(config::largest_policy_input(robot_), policy_input_bytes(2, 3 + 5 + 2 + 10 + 12));
  auto other = robot_;
  other.record.policy_inputs = false;
  EXPECT_EQ(config::largest_policy_input(other), 0U);
  other = robot_;
  other.sensors[1].values = 0;
  other.sensors[1].image = config::ImageShape{48, 64, 3};
  EXPECT_EQ(config::largest_policy_input(other), policy_input_bytes(2, 3 + 5 + 3 + 2 * 9216 + 3 + 12))
      << "an image is part of the network's input";
  other.sensors[1].image = config::ImageShape{128, 128, 3};
  EXPECT_EQ(config::largest_policy_input(other), 0U) << "too large";
  other = robot_;
  other.policy->observation[1].history = 1U << 20U;
  EXPECT_EQ(config::largest_policy_input(other), 0U) << "too large";
  other.policy.reset();
  EXPECT_EQ(config::largest_policy_input(other), 0U);
}

}  // namespace
}  // namespace takt::policy_host
