// SPDX-License-Identifier: Apache-2.0
// Goal: what a network was shown and said leaves the host as it was, with the samples it was made from, and says when
// the network had forgotten its past. Method: the responder with a scripted policy; the packed bytes are taken apart
// here by the layout that the contract states.
#include "policy_host/input_evidence.hpp"

#include <gtest/gtest.h>

#include <array>
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
  EXPECT_EQ(header.sample_count, 1U) << "the idle sensor fed nothing";
  EXPECT_EQ(header.built_in, 1);
  EXPECT_EQ(header.by_client, 0);
  EXPECT_EQ(header.quantities, 1) << "q";
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

// Goal: images are named where they stood and are nowhere else in the payload, histories included; what is left of the
// input is the rest in its order, and the places say how to put it together again. Method: a history of two images
// between other terms, by term and by time, oldest and newest first; the input is rebuilt here and compared.
TEST_F(InputEvidenceTest, ImagesAreNamedAndTheRestOfTheInputIsThere) {
  for (const bool by_time : {false, true}) {
    for (const bool newest_first : {false, true}) {
      config::RobotConfig seeing = robot_;
      seeing.sensors[1] = {.name = "eye", .timeout = milliseconds(200), .image = config::ImageShape{2, 3, 2}};
      seeing.policy->history_layout = by_time ? "by_time" : "by_term";
      seeing.policy->history_order = newest_first ? "newest_first" : "oldest_first";
      for (config::ObservationTerm& each : seeing.policy->observation) each.history = 2;
      ScriptedPolicy policy(6 + 24 + 6, 12);
      Responder responder(seeing, 7, policy);
      InputEvidence evidence(seeing, 7, true);
      responder.start_session();
      std::array<std::vector<std::uint8_t>, 3> shown;
      for (std::size_t image = 0; image < 3; ++image)
        for (std::size_t i = 0; i < 12; ++i) shown[image].push_back(static_cast<std::uint8_t>(50 * image + i));
      std::span<const std::byte> payload;
      for (std::size_t i = 0; i < 3; ++i) {
        samples_[1] = small_sample(50 + i, 0, 0);
        samples_[1].published_at = MonoTime{} + milliseconds(static_cast<std::int64_t>(9 + i));
        const std::array<std::span<const std::uint8_t>, 2> images{std::span<const std::uint8_t>{}, shown[i]};
        const Observation observation = small_observation(40 + i);
        const CommandChunk& chunk = responder.answer(observation, samples_, still_clock(), still_clock, images);
        payload = evidence.pack(observation, samples_, chunk.header.sequence, responder.inference());
      }
      const PolicyInputHeader header = header_of(payload);
      ASSERT_EQ(header.sample_count, 2U) << "the images, and no other sensor";
      ASSERT_EQ(header.input_count, 12U);
      ASSERT_EQ(payload.size(), policy_input_bytes(2, 3 + 12 + 12));
      std::array<PolicyInputSample, 2> named;
      std::memcpy(named.data(), payload.data() + sizeof header, sizeof named);
      EXPECT_EQ(named[newest_first ? 1 : 0].sequence, 51U);
      EXPECT_EQ(named[newest_first ? 0 : 1].sequence, 52U);
      EXPECT_EQ(named[newest_first ? 0 : 1].published_at, MonoTime{} + milliseconds(11));
      EXPECT_EQ(named[0].sensor, 1U);
      EXPECT_EQ(named[0].value_count, 0U);

      const ObservationBuilder builder(seeing);
      std::vector<float> rest(12), rebuilt(36);
      std::memcpy(rest.data(), payload.data() + sizeof header + sizeof named + 4 * std::size_t{3}, 48);
      std::size_t from = 0, at = 0;
      for (std::size_t i = 0; i < 2; ++i) {
        const ImagePlace& place = builder.image_places().at(i);
        for (; at < place.at; ++at) rebuilt[at] = rest.at(from++);
        builder.put_image(place, shown.at(named.at(i).sequence - 50), rebuilt);
        at += place.width;
      }
      for (; at < rebuilt.size(); ++at) rebuilt[at] = rest.at(from++);
      EXPECT_EQ(rebuilt, policy.last_input) << by_time << newest_first;
    }
  }
}

// Goal: what was promised of this policy's own path is told, and of another's nothing.
TEST_F(InputEvidenceTest, ThePromiseIsThisPolicysOwn) {
  responder_.start_session();
  Observation observation = small_observation(1);
  observation.command_sequence = 17;
  observation.committed_from = 3;
  observation.committed_count = 5;
  samples_[1] = small_sample(1, 0, 0);
  const CommandChunk& chunk = responder_.answer(observation, samples_, still_clock(), still_clock);
  const auto promised = [&](InputEvidence& evidence) {
    const auto header = header_of(evidence.pack(observation, samples_, chunk.header.sequence, responder_.inference()));
    return std::array<std::uint64_t, 3>{header.following, header.committed_from, header.committed_count};
  };
  const std::array<std::uint64_t, 3> its{17, 3, 5}, none{0, 0, 0};
  InputEvidence candidate(robot_, 7, true, PathOwner::candidate), fallback(robot_, 7, true, PathOwner::nobody);
  EXPECT_EQ(promised(evidence_), its);
  EXPECT_EQ(promised(candidate), none);
  observation.of_candidate = 1;
  EXPECT_EQ(promised(evidence_), none);
  EXPECT_EQ(promised(candidate), its);
  EXPECT_EQ(promised(fallback), none);
}

// Goal: what is announced as the largest payload is the largest, and robots whose inputs cannot be recorded say so.
TEST_F(InputEvidenceTest, TheLargestPayloadIsKnownFromTheRobotFile) {
  EXPECT_EQ(config::largest_policy_input(robot_), policy_input_bytes(2, 3 + 5 + 2 + 10 + 12));
  auto other = robot_;
  other.record.policy_inputs = false;
  EXPECT_EQ(config::largest_policy_input(other), 0U);
  other = robot_;
  other.sensors[1].values = 0;
  other.sensors[1].image = config::ImageShape{1024, 1024, 3};
  EXPECT_EQ(config::largest_policy_input(other), policy_input_bytes(2 + 2, 3 + 5 + 3 + 3 + 12))
      << "images are named, however large, each of a history";
  other = robot_;
  other.sensors[0].queue = 10;
  EXPECT_EQ(config::largest_policy_input(other), policy_input_bytes(11 + 1, 5 * 3 + 11 * 5 + 2))
      << "of a client: all quantities of the joints, the newest sample and a queue";
  other = robot_;
  other.policy->observation[1].history = 1U << 20U;
  EXPECT_EQ(config::largest_policy_input(other), 0U) << "too large";
  other.policy.reset();
  EXPECT_EQ(config::largest_policy_input(other), 0U);
}

}  // namespace
}  // namespace takt::policy_host
