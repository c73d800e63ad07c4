// SPDX-License-Identifier: Apache-2.0
// Goal: a frame holds what the policy was given and what it asked for at that instant, and an episode holds nothing
// else than the robot following its policy without a gap. Method: recorded runs of the virtual robot, whose policy's
// targets are a known function of the observation and the step; records taken out or altered.
#include "lab/data_set/episode.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::data_set {
namespace {

using monitor::RecordedCommand;
using monitor::RecordedRun;

class Episodes : public test::TemporaryFolder {
 protected:
  [[nodiscard]] const RecordedRun& run() const { return run_; }
  static std::map<std::uint64_t, TickRecord> ticks_of(const RecordedRun& run) {
    std::map<std::uint64_t, TickRecord> ticks;
    const auto keep = [&](const monitor::RecordedTick& tick) { ticks[tick.record.header.tick] = tick.record; };
    EXPECT_TRUE(scan_run(run, {.tick = keep, .command = {}, .keyframe = {}, .loss = {}}));
    return ticks;
  }
  [[nodiscard]] RecordedRun altered(
      const std::function<void(TickRecord&)>& tick, const std::function<void(RecordedCommand&)>& command,
      const std::function<bool(std::uint64_t)>& keeps = [](std::uint64_t) { return true; }) const {
    return monitor::altered_copy(run(), path("altered"), tick, command, keeps);
  }
  // As a forger writes it who makes checksums, too.
  std::string refusal_of_forged(const std::function<void(TickRecord&)>& tick,
                                const std::function<void(RecordedCommand&)>& command) {
    const auto all = [](std::uint64_t) { return true; };
    const RecordedRun forged = monitor::altered_copy(run(), path("forged" + std::to_string(++forged_)), tick, command,
                                                     all, monitor::Checksums::made_anew);
    const auto found = episodes_of(forged);
    return found ? "" : found.error();
  }
  // Alters the header of the first command from tick 800 on.
  static std::function<void(RecordedCommand&)> with_header(const std::function<void(CommandHeader&)>& alter) {
    return [alter, done = false](RecordedCommand& command) mutable {
      if (done || command.tick < 800) return;
      done = true;
      CommandHeader header = *header_of(command);
      alter(header);
      std::memcpy(command.payload.data(), &header, sizeof header);
    };
  }

 private:
  RecordedRun run_ = monitor::record_demo(path("run"));
  int forged_ = 0;
};

TEST_F(Episodes, AFrameIsWhatThePolicyWasGivenAndWhatItAskedForThen) {
  const auto found = episodes_of(run());
  ASSERT_TRUE(found) << found.error();
  const auto ticks = ticks_of(run());
  std::map<std::uint64_t, std::uint64_t> tick_of_observation;
  for (const auto& [number, record] : ticks) tick_of_observation[record.header.observation_published] = number;
  const std::size_t joints = run().robot.joints.size();
  std::size_t frames = 0;
  for (const Episode& episode : found->episodes) {
    std::size_t frame = 0;
    for (auto at = ticks.find(episode.first_tick); at != ticks.end() && at->first <= episode.last_tick; ++at) {
      const TickRecordHeader& header = at->second.header;
      EXPECT_EQ(header.mode, Mode::tracking);
      if (header.observation_published == 0) continue;
      const double answered =
          static_cast<double>(tick_of_observation.at(header.seats[Seat::policy].observation_answered));
      for (std::size_t joint = 0; joint < joints; ++joint) {
        EXPECT_EQ(episode.states.at(frame * 2 * joints + joint), at->second.joints[joint].q_estimate);
        EXPECT_EQ(episode.states.at((frame * 2 + 1) * joints + joint), at->second.joints[joint].dq_estimate);
        const auto said = static_cast<float>(run().robot.joints[joint].home) +
                          0.2F * static_cast<float>(std::sin((answered + 10.0 * header.chunk_step) * 0.002));
        EXPECT_NEAR(episode.actions.at(frame * joints + joint), said, 1e-6F) << at->first;
      }
      ++frame;
    }
    EXPECT_EQ(frame, episode.frames);
    frames += frame;
  }
  EXPECT_GT(frames, 100U);
  EXPECT_GT(found->observations, frames) << "before arming, and while nobody answered";
}

// The policy answers nothing from tick 1500 to 1900 and from 3000 on.
TEST_F(Episodes, EndWhereTheRobotStopsFollowingItsPolicy) {
  const auto found = episodes_of(run());
  ASSERT_TRUE(found);
  ASSERT_EQ(found->episodes.size(), 2U);
  const auto ticks = ticks_of(run());
  EXPECT_GT(found->episodes[0].last_tick, 1'500U);
  EXPECT_LT(found->episodes[0].last_tick, 1'900U);
  EXPECT_GT(found->episodes[1].first_tick, 1'900U);
  const auto left = std::ranges::find_if(ticks, [&](const auto& each) {
    return each.first > found->episodes[0].first_tick && each.second.header.mode != Mode::tracking;
  });
  EXPECT_LT(found->episodes[0].last_tick, left->first);
  EXPECT_GE(found->episodes[0].last_tick + 20, left->first) << "up to the last observation before";
}

constexpr std::uint64_t kOther = 0xFEDC'BA98'7654'3210;

// After `takt policy swap` commands and ticks are of another policy than the manifest's.
TEST_F(Episodes, AnEpisodeIsOfThePolicyThatMovedIt) {
  std::uint64_t swapped = 0;
  const auto see = [&](const RecordedCommand& command) {
    if (swapped == 0 && command.tick >= 1'000) swapped = command.tick;
  };
  ASSERT_TRUE(scan_run(run(), {.tick = {}, .command = see, .keyframe = {}, .loss = {}}));
  const auto later_ticks = [&](TickRecord& record) {
    if (record.header.tick >= swapped) record.header.command_policy = kOther;
  };
  const auto later_commands = [&](RecordedCommand& command) {
    CommandHeader header = *header_of(command);
    if (command.tick >= swapped) header.policy_hash = kOther;
    std::memcpy(command.payload.data(), &header, sizeof header);
  };
  const auto all = [](std::uint64_t) { return true; };
  const auto found = episodes_of(
      monitor::altered_copy(run(), path("swapped"), later_ticks, later_commands, all, monitor::Checksums::made_anew));
  ASSERT_TRUE(found) << found.error();
  ASSERT_EQ(found->episodes.size(), 3U);
  EXPECT_EQ(found->episodes[0].policy, monitor::VirtualRobot::kPolicyHash);
  EXPECT_LT(found->episodes[0].last_tick, swapped);
  EXPECT_EQ(found->episodes[1].policy, kOther);
  EXPECT_GE(found->episodes[1].first_tick, swapped);
  EXPECT_LT(found->episodes[1].first_tick, swapped + 20);
  EXPECT_EQ(found->episodes[2].policy, kOther);
}

// Every policy counts its commands from 1: of two with the same number only its own is what a tick played.
TEST_F(Episodes, ACommandOfAnotherPolicyIsNotTakenForItsNumber) {
  const auto meanwhile = [](TickRecord& record) {
    if (record.header.tick >= 1'000 && record.header.tick < 1'200) record.header.command_policy = kOther;
  };
  const auto all = [](std::uint64_t) { return true; };
  const auto found = episodes_of(monitor::altered_copy(
      run(), path("numbers"), meanwhile, [](RecordedCommand&) {}, all, monitor::Checksums::made_anew));
  ASSERT_TRUE(found) << found.error();
  ASSERT_EQ(found->episodes.size(), 3U);
  EXPECT_LT(found->episodes[0].last_tick, 1'000U);
  EXPECT_GE(found->episodes[1].first_tick, 1'200U);
}

// A robot that slows down in degraded mode goes on following its policy, but not as the policy meant it.
TEST_F(Episodes, EndWithDegradedModeThoughThePolicyGoesOnMovingTheRobot) {
  config::RobotConfig slowing = monitor::demo_robot();
  slowing.degraded.behaviour = config::Degraded::slow;
  monitor::VirtualRobot robot(slowing);
  const auto freeze = [&](std::uint64_t tick) { robot.policy_is_frozen = tick >= 1'500 && tick < 1'800; };
  const RecordedRun run = monitor::record(robot, path("slow"), 3'000, freeze);
  const auto ticks = ticks_of(run);
  const bool is_moved_by_it = std::ranges::any_of(ticks, [](const auto& each) {
    return each.second.header.mode == Mode::degraded && each.second.header.player == Player::policy &&
           each.second.header.observation_published != 0;
  });
  EXPECT_TRUE(is_moved_by_it);
  const auto found = episodes_of(run);
  ASSERT_TRUE(found) << found.error();
  ASSERT_EQ(found->episodes.size(), 2U);
  for (const Episode& episode : found->episodes) {
    for (auto at = ticks.find(episode.first_tick); at->first != episode.last_tick; ++at)
      ASSERT_EQ(at->second.header.mode, Mode::tracking) << at->first;
  }
}

TEST_F(Episodes, EndAtAGapInTheRecording) {
  const RecordedRun torn =
      altered([](TickRecord&) {}, [](RecordedCommand&) {}, [](std::uint64_t tick) { return tick != 1'051; });
  const auto found = episodes_of(torn);
  ASSERT_TRUE(found) << found.error();
  ASSERT_EQ(found->episodes.size(), 3U);
  EXPECT_LE(found->episodes[0].last_tick, 1'050U);
  EXPECT_GE(found->episodes[1].first_tick, 1'052U);
}

TEST_F(Episodes, EndWhereTheCommandInUseIsNotInTheRecording) {
  bool done = false;
  const RecordedRun torn = altered([](TickRecord&) {},
                                   [&](RecordedCommand& command) {
                                     if (done || command.tick < 1'000) return;
                                     done = true;
                                     CommandHeader header = *header_of(command);
                                     header.sequence += 1'000'000;
                                     std::memcpy(command.payload.data(), &header, sizeof header);
                                     command.crc = crc_of(command);
                                   });
  const auto found = episodes_of(torn);
  ASSERT_TRUE(found) << found.error();
  EXPECT_EQ(found->episodes.size(), 3U);
  EXPECT_LT(found->episodes[0].last_tick, 1'040U);
}

TEST_F(Episodes, EndWhereObservationsAreNotAPeriodApart) {
  monitor::VirtualRobot robot;
  robot.spoil_input = [](pipeline::TickInput& input) {
    if (input.tick >= 1'005) input.now = input.now + milliseconds(11);  // stood still, once
  };
  const auto found = episodes_of(monitor::record(robot, path("stalled"), 1'600, [](std::uint64_t) {}));
  ASSERT_TRUE(found) << found.error();
  ASSERT_EQ(found->episodes.size(), 2U);
  EXPECT_LE(found->episodes[0].last_tick, 1'005U);
  EXPECT_GE(found->episodes[1].first_tick, 1'005U);
}

TEST_F(Episodes, AnAlteredTickIsRefusedAndNamed) {
  const auto found = episodes_of(
      altered([](TickRecord& record) { record.joints[2].q_estimate += record.header.tick == 777 ? 0.01F : 0.0F; },
              [](RecordedCommand&) {}));
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().find("tick 777 was altered"), std::string::npos) << found.error();
}

TEST_F(Episodes, AnAlteredCommandIsRefusedAndNamed) {
  std::uint64_t tick = 0;
  const auto found = episodes_of(altered([](TickRecord&) {},
                                         [&](RecordedCommand& command) {
                                           if (tick != 0 || command.tick < 800) return;
                                           tick = command.tick;
                                           command.payload.back() ^= std::byte{1};
                                         }));
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().find("the command that tick " + std::to_string(tick) + " read was altered"),
            std::string::npos)
      << found.error();
}

// Counts in a command say where its values lie: none of them is believed before the record is.
TEST_F(Episodes, ACommandWhoseHeaderWasAlteredIsRefusedBeforeItsValuesAreRead) {
  const auto larger = [](CommandHeader& header) {
    header.joint_count = 65'535;
    header.fields = kAllCommandFields;
  };
  const auto found = episodes_of(altered([](TickRecord&) {}, with_header(larger)));
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().find(" was altered since"), std::string::npos) << found.error();
}

TEST_F(Episodes, CountsThatNoExecutiveAcceptsAreRefusedThoughTheirChecksumIsRight) {
  const auto leave = [](TickRecord&) {};
  const std::function<void(CommandHeader&)> changes[] = {
      [](CommandHeader& header) { header.joint_count = 65'535; },
      [](CommandHeader& header) { header.joint_count = 5; },
      [](CommandHeader& header) { header.step_count = 65'535; },
      [](CommandHeader& header) { header.step_count = 0; },
      [](CommandHeader& header) { header.fields = kAllCommandFields; },
  };
  for (const auto& change : changes) {
    const std::string refusal = refusal_of_forged(leave, with_header(change));
    EXPECT_NE(refusal.find("is none that an executive accepts"), std::string::npos) << refusal;
  }
  const auto shorten = [done = false](RecordedCommand& command) mutable {
    if (!done && command.tick >= 800) command.payload.resize(sizeof(CommandHeader) - 1);
    done = done || command.tick >= 800;
  };
  EXPECT_NE(refusal_of_forged(leave, shorten).find("is none that an executive accepts"), std::string::npos);
  const auto at_900 = [](auto change) {
    return [change](TickRecord& record) {
      if (record.header.tick == 900) change(record.header);
    };
  };
  const auto leave_command = [](RecordedCommand&) {};
  EXPECT_NE(refusal_of_forged(at_900([](TickRecordHeader& header) { header.chunk_step = 200; }), leave_command)
                .find("tick 900 plays step 200 of 16"),
            std::string::npos);
  EXPECT_NE(refusal_of_forged(at_900([](TickRecordHeader& header) { header.joint_count = 5; }), leave_command)
                .find("tick 900 is of 5 joints"),
            std::string::npos);
}

TEST_F(Episodes, WhatHoldsNothingToLearnIsRefused) {
  RecordedRun without = run();
  without.robot.policy.reset();
  ASSERT_FALSE(episodes_of(without));
  EXPECT_NE(episodes_of(without).error().find("has no policy"), std::string::npos);
  monitor::VirtualRobot robot;
  robot.policy_is_frozen = true;
  const auto idle = episodes_of(monitor::record(robot, path("idle"), 400, [](std::uint64_t) {}));
  ASSERT_FALSE(idle);
  EXPECT_NE(idle.error().find("nothing to export"), std::string::npos) << idle.error();
}

// Actions are read from the field that the policy's kind of action is sent in; a passive joint has none.
TEST_F(Episodes, AnActionIsOfThePolicysKindAndOfJointsThatAct) {
  RecordedRun other = run();
  other.robot.policy->action.kind = config::ActionKind::joint_velocity;
  other.robot.joints[5].passive = true;
  other.robot.joints[4].kind = config::JointKind::slide;
  const auto found = episodes_of(other);
  ASSERT_TRUE(found);
  const Episode& episode = found->episodes.front();
  EXPECT_EQ(found->robot.acting_joints.size(), 5U);
  EXPECT_EQ(found->robot.slides, std::vector{other.robot.joints[4].name});
  EXPECT_EQ(episode.actions.size(), 5 * episode.frames);
  EXPECT_EQ(episode.states.size(), 12 * episode.frames);
  EXPECT_TRUE(std::ranges::all_of(episode.actions, [](float value) { return value == 0; })) << "its policy sends no dq";
}

TEST(DataSetRobot, WhatCannotStandTogetherIsSaid) {
  const Robot arm{"arm", {"a", "b"}, {"a"}, milliseconds(20), config::ActionKind::joint_position, {}};
  const auto with = [&](auto change) {
    Robot other = arm;
    change(other);
    return difference(arm, other);
  };
  EXPECT_EQ(difference(arm, arm), "");
  EXPECT_EQ(with([](Robot& other) { other.name = "leg"; }), "one is of robot arm, the other of leg");
  EXPECT_EQ(with([](Robot& other) { other.joints = {"a", "c"}; }), "one is of joints a, b, the other of a, c");
  EXPECT_EQ(with([](Robot& other) { other.slides = {"b"}; }), "one is of slides none, the other of b");
  EXPECT_EQ(with([](Robot& other) { other.period = milliseconds(10); }),
            "one is of a policy with period 20 ms, the other of 10 ms");
  EXPECT_EQ(with([](Robot& other) { other.action = config::ActionKind::joint_torque; }),
            "one is of actions that are joint positions, the other of joint torques");
}

}  // namespace
}  // namespace takt::data_set
