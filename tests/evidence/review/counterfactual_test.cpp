// SPDX-License-Identifier: Apache-2.0
// Goal: behind a stop the report says which other value of the key that governs its rule would have kept it from
// firing, the smallest one of the grid, and says nothing where replay cannot know. Method: runs recorded in virtual
// time that suffer a disturbance; then two more robots live through the same, with the value that was named, which must
// not stop, and with the value a step below, which must.
#include "evidence/review/counterfactual.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "config/load.hpp"
#include "evidence/review/run_review.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

// Late enough that replay must begin at a keyframe.
constexpr std::uint64_t kStrikesAt = 6'500, kTicks = 9'000;

struct Disturbance {
  const char* name;
  Cause cause;
  void (*every_20)(VirtualRobot& robot, std::uint64_t tick);
  void (*spoil)(pipeline::TickInput& input);
  const char* key;
  const char* named;       // smallest value that keeps the rule from firing
  const char* step_below;  // that does not
  const char* words;
  friend void PrintTo(const Disturbance& each, std::ostream* out) { *out << each.name; }
};

bool strikes(std::uint64_t tick, std::uint64_t ticks) {
  return tick >= kStrikesAt && tick < kStrikesAt + ticks;
}

const Disturbance kDisturbances[] = {
    {"policy_frozen_for_900_ms", Cause::command_lost,
     [](VirtualRobot& robot, std::uint64_t tick) { robot.policy_is_frozen = strikes(tick, 900); },
     [](pipeline::TickInput&) {}, "freshness.stop_after", "850 ms", "800 ms", "it would have gone on"},
    {"policy_slow_from_then_on", Cause::command_lost,
     [](VirtualRobot& robot, std::uint64_t tick) { robot.answer_ticks = tick < kStrikesAt ? 12 : 157; },
     [](pipeline::TickInput&) {}, "freshness.max_age", "190 ms", "180 ms", "it would have gone on"},
    {"joint_silent_for_63_ms", Cause::feedback_lost, [](VirtualRobot&, std::uint64_t) {},
     [](pipeline::TickInput& input) {
       static JointFeedback last;
       if (!strikes(input.tick, 63)) last = input.joints[2];
       input.joints[2] = last;
     },
     "feedback.timeout", "64 ms", "62 ms", "this rule would not have fired"},
    {"loop_late_every_other_tick_for_800_ms", Cause::overrun, [](VirtualRobot&, std::uint64_t) {},
     [](pipeline::TickInput& input) {
       if (strikes(input.tick, 800) && input.tick % 2 == 0) input.lateness = milliseconds(2);
     },
     "control.late_share", "0.4", "0.38", "it would have gone on"},
};

class Counterfactuals : public test::TemporaryFolder, public testing::WithParamInterface<Disturbance> {
 protected:
  static void live(VirtualRobot& robot) { robot.spoil_input = GetParam().spoil; }
  RecordedRun recorded() {
    VirtualRobot robot;
    live(robot);
    return record(robot, path("run"), kTicks, [&](std::uint64_t tick) { GetParam().every_20(robot, tick); });
  }
  static bool stops_with(const char* value) {
    const config::Override other{GetParam().key, value};
    VirtualRobot robot(config::with_overrides(demo_robot(), std::span(&other, 1)).value());
    live(robot);
    bool stopped = false;
    for (std::uint64_t tick = 0; tick < kTicks && !stopped; tick += 20) {
      GetParam().every_20(robot, tick);
      robot.run(20);
      const Mode mode = robot.latest().header.mode;
      stopped = mode == Mode::damped_stop || mode == Mode::fault_latched;
    }
    return stopped;
  }
};

TEST_P(Counterfactuals, NamesTheSmallestValueThatWouldHaveKeptItGoing) {
  const auto review = evidence::review_of(recorded());
  ASSERT_TRUE(review);
  ASSERT_EQ(review->metrics.incidents.size(), 1U);
  const incident::Incident& incident = review->metrics.incidents.front();
  EXPECT_EQ(incident.cause, GetParam().cause);
  const std::string with = "with " + std::string(GetParam().key) + " " + GetParam().named + " (was ";
  EXPECT_NE(incident.counterfactual.find(with), std::string::npos) << incident.counterfactual;
  EXPECT_NE(incident.counterfactual.find(GetParam().words), std::string::npos) << incident.counterfactual;
  EXPECT_FALSE(stops_with(GetParam().named));
  EXPECT_TRUE(stops_with(GetParam().step_below));
}

INSTANTIATE_TEST_SUITE_P(Disturbed, Counterfactuals, testing::ValuesIn(kDisturbances),
                         [](const auto& each) { return std::string(each.param.name); });

class CounterfactualTest : public test::TemporaryFolder {
 protected:
  static std::string told_of(const RecordedRun& run) {
    const auto review = evidence::review_of(run);
    return review && !review->metrics.incidents.empty() ? review->metrics.incidents.front().counterfactual : "no stop";
  }
  RecordedRun frozen(std::uint64_t ticks_frozen, std::uint64_t ticks) {
    VirtualRobot robot;
    return record(robot, path("run"), ticks,
                  [&](std::uint64_t tick) { robot.policy_is_frozen = strikes(tick, ticks_frozen); });
  }
};

TEST_F(CounterfactualTest, OfAPolicyThatNeverSpokeAgainItSaysSo) {
  EXPECT_EQ(told_of(frozen(kTicks, kTicks)),
            "by replay: no other freshness.max_age or freshness.stop_after would have helped: nothing more came in the "
            "1.8 s recorded behind it");
}

TEST_F(CounterfactualTest, OfARecordingThatEndsWithTheStopItSaysNothing) {
  EXPECT_EQ(told_of(frozen(kTicks, kStrikesAt + 800)), "");
}

// What an altered or torn recording decides again is not what happened.
TEST_F(CounterfactualTest, OfARecordingThatDoesNotReproduceItSaysNothing) {
  const RecordedRun run = frozen(900, kTicks);
  ASSERT_NE(told_of(run), "");
  const auto leave_tick = [](TickRecord&) {};
  const auto leave_command = [](RecordedCommand&) {};
  const auto all = [](std::uint64_t) { return true; };
  const auto push = [](TickRecord& record) {
    if (record.header.tick == kStrikesAt) record.joints[0].feedback.q += 0.01F;
  };
  EXPECT_EQ(told_of(altered_copy(run, path("altered"), push, leave_command, all)), "");
  // Between its last keyframe and the stop.
  const auto most = [](std::uint64_t tick) { return tick < kStrikesAt + 700 || tick >= kStrikesAt + 704; };
  EXPECT_EQ(told_of(altered_copy(run, path("torn"), leave_tick, leave_command, most)), "");
}

// The stop itself changes how far the robot swings: no replay knows what a wider envelope would have led to.
TEST_F(CounterfactualTest, OfCausesThatTheStopItselfChangesItSaysNothing) {
  VirtualRobot robot;
  float stood = 0;
  robot.spoil_input = [stood](pipeline::TickInput& input) mutable {
    if (input.tick < kStrikesAt) {
      stood = input.joints[1].q;
      return;  // then it is too fast, and plausibly so
    }
    const std::uint64_t ticks = std::min<std::uint64_t>(input.tick - kStrikesAt + 1, 30);
    input.joints[1].q = stood + 0.01F * static_cast<float>(ticks);
    input.joints[1].dq = strikes(input.tick, 30) ? 10.0F : 0.0F;
  };
  const RecordedRun run = record(robot, path("run"), kTicks, [](std::uint64_t) {});
  const auto review = evidence::review_of(run);
  ASSERT_TRUE(review);
  ASSERT_FALSE(review->metrics.incidents.empty());
  EXPECT_EQ(review->metrics.incidents.front().cause, Cause::envelope_exceeded);
  EXPECT_EQ(review->metrics.incidents.front().counterfactual, "");
}

}  // namespace
}  // namespace takt::monitor
