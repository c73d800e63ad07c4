// SPDX-License-Identifier: Apache-2.0
// Goal: an answer goes out with the earlier ones mixed in by the rule that policy.action.join names, what cannot be
// mixed goes out as it is, and nothing of an answer that is not finite or not played stays. Method: chunks on one grid
// against the published formulas; random chunks at random instants against the path that was published before.
#include "policy_host/chunk_mixer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "config/load.hpp"

namespace takt::policy_host {
namespace {

using config::Interpolation;
using config::JoinKind;

constexpr MonoTime kStart{1'000'000'000};
constexpr Duration kStep = milliseconds(10);

// One joint's answers, mixed as often as one likes.
class Answers {
 public:
  explicit Answers(const config::Join& join, Interpolation interpolation = Interpolation::linear,
                   PathOwner owner = PathOwner::policy)
      : robot_(robot_with(join, interpolation)), mixer_(robot_, owner) {
    observation.command_sequence = 1;
  }

  // Answers an observation published `begins` after the start, at `now`; the robot follows an earlier answer.
  void answer(Duration begins, Duration now, const std::vector<float>& q, const std::vector<float>& dq = {},
              Duration period = kStep) {
    CommandHeader& header = sent_->header;
    header.step_count = static_cast<std::uint16_t>(q.size());
    header.joint_count = 1;
    header.step_period = period;
    header.fields = static_cast<std::uint8_t>(CommandField::q);
    if (!dq.empty()) header.fields |= static_cast<std::uint8_t>(CommandField::dq);
    for (std::size_t k = 0; k < q.size(); ++k) {
      sent_->values[value_index(header, CommandField::q, k, 0)] = q[k];
      if (!dq.empty()) sent_->values[value_index(header, CommandField::dq, k, 0)] = dq[k];
    }
    begins_ = kStart + begins;
    observation.published_at = begins_;
    mixer_.mix(observation, kStart + now, *sent_);
  }
  void forget() { mixer_.forget(); }
  [[nodiscard]] float step(std::size_t k, CommandField field = CommandField::q) const {
    return sent_->values[value_index(sent_->header, field, k, 0)];
  }
  [[nodiscard]] PathPoint at(Duration since) const {
    const Place place = place_of(sent_->header, kStart + since - begins_, false);
    if ((sent_->header.fields & static_cast<unsigned>(CommandField::dq)) == 0)
      return line(step(place.step), step(place.next), place);
    return cubic(step(place.step), step(place.step, CommandField::dq), step(place.next),
                 step(place.next, CommandField::dq), place);
  }

  Observation observation;

 private:
  static config::RobotConfig robot_with(const config::Join& join, Interpolation interpolation) {
    config::RobotConfig robot = config::load("config/arm6.yaml").value();
    robot.joints.resize(1);
    robot.joints[0].limits.q_min = -2;
    robot.joints[0].limits.q_max = 20;
    robot.joints[0].limits.velocity = 100;
    robot.policy->steps = 32;
    robot.policy->action.join = join;
    robot.policy->action.interpolation = interpolation;
    return robot;
  }
  config::RobotConfig robot_;
  ChunkMixer mixer_;
  std::unique_ptr<CommandChunk> sent_ = std::make_unique<CommandChunk>();
  MonoTime begins_;
};

config::Join blend(double new_share = 0.7) {
  return {.kind = JoinKind::blend, .over = {}, .new_share = new_share, .decay = 0, .taper = {}, .longest = {}};
}
config::Join ensemble(double decay, Duration taper = {}) {
  return {.kind = JoinKind::ensemble, .over = {}, .new_share = 0, .decay = decay, .taper = taper, .longest = {}};
}
config::Join fading(JoinKind kind, Duration over) {
  return {.kind = kind, .over = over, .new_share = 0, .decay = 0, .taper = {}, .longest = {}};
}

TEST(ChunkMixer, BlendMixesWhereBothSaySomething) {
  Answers answers(blend());
  answers.answer({}, {}, {0, 1, 2, 3});
  answers.answer(milliseconds(10), milliseconds(10), {10, 10, 10, 10});
  EXPECT_FLOAT_EQ(answers.step(0), 0.3F * 1 + 7);
  EXPECT_FLOAT_EQ(answers.step(1), 0.3F * 2 + 7);
  EXPECT_FLOAT_EQ(answers.step(2), 0.3F * 3 + 7);
  EXPECT_FLOAT_EQ(answers.step(3), 10) << "beyond the old chunk's end";
}

// What a cubic path says between its steps is what is mixed, not the straight line: steps that lie half way between the
// old one's. Hermite: (q0 + q1) / 2 + h / 8 (dq0 - dq1), dq: 3 / 2 (q1 - q0) / h - (dq0 + dq1) / 4.
TEST(ChunkMixer, ACubicPathIsMixedAsItIsPlayed) {
  Answers answers(blend(), Interpolation::cubic);
  answers.answer({}, {}, {0, 0, 1, 1, 1}, {0, 10, 20, 0, 0});
  answers.answer(milliseconds(15), milliseconds(15), {3, 3, 3}, {0, 0, 0});
  EXPECT_FLOAT_EQ(answers.step(0), 0.3F * (0.5F + 0.01F / 8 * (10 - 20)) + 0.7F * 3);
  EXPECT_FLOAT_EQ(answers.step(0, CommandField::dq), 0.3F * (1.5F * 100 - 0.25F * 30));
}

// ACT: w_i = exp(-m i), i = 0 the oldest, normalised; here against the sum over all predictions.
TEST(ChunkMixer, AnEnsembleIsTheWeightedMeanOfAllPredictions) {
  constexpr double kM = 0.1;
  Answers answers(ensemble(kM));
  std::vector<std::vector<float>> said;
  std::mt19937 random(3);
  for (int made = 0; made < 12; ++made) {
    std::vector<float> q(8);
    for (float& value : q) value = std::uniform_real_distribution<float>(-1, 1)(random);
    said.push_back(q);
    answers.answer(kStep * made, kStep * made, q);
    for (std::size_t k = 0; k < 8; ++k) {
      double sum = 0, weights = 0;
      int i = 0;
      for (std::size_t c = 0; c < said.size(); ++c) {
        const std::size_t ahead = said.size() - 1 - c + k;
        if (ahead >= 8) continue;
        const double weight = std::exp(-kM * i++);
        sum += weight * static_cast<double>(said[c][ahead]);
        weights += weight;
      }
      EXPECT_NEAR(answers.step(k), sum / weights, 1e-5) << "answer " << made << ", step " << k;
    }
  }
}

TEST(ChunkMixer, AnEnsemblesTaperLetsTheOldEndQuietly) {
  Answers answers(ensemble(0, milliseconds(40)));
  answers.answer({}, {}, {0, 0, 0, 0, 0, 0});
  answers.answer(milliseconds(10), milliseconds(10), {1, 1, 1, 1, 1, 1});
  // Old weight: what is left of the old chunk over the taper, 1 at most.
  EXPECT_FLOAT_EQ(answers.step(0), 0.5F);
  EXPECT_FLOAT_EQ(answers.step(2), 1.0F / 1.75F);
  EXPECT_FLOAT_EQ(answers.step(4), 1.0F / 1.25F);
  EXPECT_FLOAT_EQ(answers.step(5), 1.0F);
}

TEST(ChunkMixer, AlignFadesTheDifferenceInAStraightLine) {
  Answers answers(fading(JoinKind::align, milliseconds(100)));
  answers.answer({}, {}, {0.2F, 0.2F, 0.2F, 0.2F});
  answers.answer(milliseconds(10), milliseconds(20), std::vector<float>(16, 1.0F));
  EXPECT_FLOAT_EQ(answers.at(milliseconds(20)).q, 0.2F);
  EXPECT_FLOAT_EQ(answers.at(milliseconds(70)).q, 0.6F);
  EXPECT_NEAR(answers.at(milliseconds(70)).dq, 8.0F, 1e-4F);
  EXPECT_FLOAT_EQ(answers.at(milliseconds(120)).q, 1.0F);
}

TEST(ChunkMixer, QuinticKeepsPositionAndVelocity) {
  Answers answers(fading(JoinKind::quintic, milliseconds(80)), Interpolation::cubic);
  answers.answer({}, {}, {0, 0.1F, 0.3F, 0.4F, 0.4F}, {1, 15, 12, 4, 0});
  const PathPoint before = answers.at(milliseconds(20));
  answers.answer(milliseconds(20), milliseconds(20), std::vector<float>(16, 0.0F), std::vector<float>(16, -3.0F));
  const PathPoint after = answers.at(milliseconds(20));
  EXPECT_NEAR(after.q, before.q, 1e-5F);
  EXPECT_NEAR(after.dq, before.dq, 1e-3F);
  EXPECT_FLOAT_EQ(answers.step(8), 0.0F) << "it has faded";
  EXPECT_FLOAT_EQ(answers.step(8, CommandField::dq), -3.0F);
}

// Where the answer is published on its grid it begins where the path of before is, whatever came before that.
TEST(ChunkMixer, WhatFadesHasNoJump) {
  std::mt19937 random(11);
  const auto draw = [&](float width) { return std::uniform_real_distribution<float>(-width, width)(random); };
  for (const JoinKind kind : {JoinKind::align, JoinKind::quintic}) {
    Answers answers(fading(kind, milliseconds(60)));
    answers.answer({}, {}, std::vector<float>(20));
    for (int join = 1; join < 200; ++join) {
      std::vector<float> q(20);
      for (float& value : q) value = draw(0.05F);  // no fade leaves the joint's range
      const Duration begins = microseconds(join * 31'700), now = begins + milliseconds(10);
      const PathPoint before = answers.at(now);
      answers.answer(begins, now, q);
      ASSERT_NEAR(answers.at(now).q, before.q, 1e-5F) << "kind " << static_cast<int>(kind) << ", join " << join;
    }
  }
}

TEST(ChunkMixer, WhatDoesNotMatchOrIsNotPlayedGoesOutAsItIs) {
  const auto first_of = [](const std::function<void(Answers&)>& then) {
    Answers answers(blend(0.5));
    answers.answer({}, {}, {0, 0, 0, 0});
    then(answers);
    return answers.step(0);
  };
  const std::vector<float> ones{1, 1, 1, 1};
  EXPECT_EQ(first_of([&](Answers& a) { a.answer(milliseconds(10), milliseconds(10), ones); }), 0.5F) << "it does";
  EXPECT_EQ(first_of([&](Answers& a) { a.answer(milliseconds(10), milliseconds(10), ones, {}, milliseconds(7)); }), 1)
      << "another period";
  EXPECT_EQ(first_of([&](Answers& a) { a.answer(milliseconds(10), milliseconds(10), ones, ones); }), 1) << "fields";
  EXPECT_EQ(first_of([&](Answers& a) { a.answer(milliseconds(-10), milliseconds(10), ones); }), 1) << "back in time";
  EXPECT_EQ(first_of([&](Answers& a) { a.answer(milliseconds(50), milliseconds(50), ones); }), 1) << "it has ended";
  EXPECT_EQ(first_of([&](Answers& a) {
              a.forget();
              a.answer(milliseconds(10), milliseconds(10), ones);
            }),
            1);
  EXPECT_EQ(first_of([&](Answers& a) {
              a.observation.command_sequence = 0;
              a.answer(milliseconds(10), milliseconds(10), ones);
            }),
            1)
      << "the robot follows none";
  EXPECT_EQ(first_of([&](Answers& a) {
              a.observation.of_candidate = 1;
              a.answer(milliseconds(10), milliseconds(10), ones);
            }),
            1)
      << "the robot follows another's";
}

// One answer that asks for what cannot be costs its own time and no more.
TEST(ChunkMixer, WhatIsOutOfRangeOrNotFiniteDoesNotWeighOnTheNextAnswer) {
  for (const float bad : {100.0F, 9.0e5F, std::numeric_limits<float>::quiet_NaN()}) {
    Answers answers(blend(0.5));
    answers.answer({}, {}, {bad, bad, bad, bad});
    answers.answer(milliseconds(10), milliseconds(10), {0, 0, 0, 0});
    EXPECT_LE(std::abs(answers.step(0)), 0.5F * 20.1F) << bad << ": the joint's range at most";
    answers.answer(milliseconds(20), milliseconds(20), {0, bad, 0, 0});
    EXPECT_EQ(std::isnan(answers.step(1)), std::isnan(bad)) << "published as it is, and refused by the executive";
  }
}

TEST(ChunkMixer, OtherJoinsLeaveTheAnswerAsItIs) {
  for (const JoinKind kind : {JoinKind::replace, JoinKind::cross_fade, JoinKind::prefix}) {
    EXPECT_FALSE(mixes_answers(kind));
    Answers answers(fading(kind, milliseconds(60)));
    answers.answer({}, {}, {0, 0, 0, 0});
    answers.answer(milliseconds(10), milliseconds(10), {1, 1, 1, 1});
    EXPECT_EQ(answers.step(0), 1.0F);
  }
}

}  // namespace
}  // namespace takt::policy_host
