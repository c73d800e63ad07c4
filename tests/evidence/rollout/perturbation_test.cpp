// SPDX-License-Identifier: Apache-2.0
// Goal: each perturbation does what its row of the table says, inside its window and nowhere else. Method: the demo
// arm's rollout with the moderate dose beside the nominal one of the same seed; records and rows are compared.
#include "evidence/rollout/perturbation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <vector>

#include "tests/evidence/rollout/arm_rollouts.hpp"

namespace takt::lab {
namespace {

constexpr MonoTime kWindow{1'002'000'000'000};  // start of the window of test::setup()

struct Seen {
  evidence::RolloutRow row;
  std::vector<std::vector<char>> before;  // every record before the window
  std::uint64_t replies = 0;              // of the first joint
  Duration oldest_feedback, latest_wake;
  int ticks_without_reply = 0;  // in the window, the longest row of them
  TickRecordHeader last;
};

void look(Seen& seen, const TickRecord& record, std::uint8_t& replies_before, int& silent) {
  const JointFeedback& joint = record.joints[0].feedback;
  const auto* const bytes = reinterpret_cast<const char*>(&record);
  const bool in_window = record.header.now >= kWindow;
  if (!in_window) seen.before.emplace_back(bytes, bytes + record.used_bytes());
  const auto more = static_cast<std::uint8_t>(joint.replies - replies_before);
  seen.replies += more;
  silent = in_window && more == 0 ? silent + 1 : 0;
  seen.ticks_without_reply = std::max(seen.ticks_without_reply, silent);
  replies_before = joint.replies;
  if (joint.received_at.is_set())
    seen.oldest_feedback = std::max(seen.oldest_feedback, record.header.now - joint.received_at);
  seen.latest_wake = std::max(seen.latest_wake, record.header.lateness);
  seen.last = record.header;
}

Seen watch(std::string_view perturbation) {
  Seen seen;
  std::uint8_t replies = 0;
  int silent = 0;
  evidence::RolloutSetup wanted = test::setup(perturbation);
  wanted.on_tick = [&](const TickRecord& record) { look(seen, record, replies, silent); };
  seen.row = test::run(wanted);
  return seen;
}

const Seen& nominal() {
  static const Seen kSeen = watch("none");
  return kSeen;
}

struct Claim {
  const char* perturbation;
  const char* when;
  bool (*holds)(const Seen& with, const Seen& without);
};

double p99(const evidence::AgeQuantiles& age) {
  return age.p99_ms.value_or(0);
}

bool found_implausible(const Seen& with, const Seen& without) {
  return with.row.failure_label == "feedback_implausible" && with.row.final_mode == Mode::fault_latched &&
         without.row.success;
}

const Claim kClaims[] = {
    {"sensor_burst", "samples arrive up to a burst late",
     [](const Seen& with, const Seen& without) {
       return p99(with.row.age_per_command.sense) > p99(without.row.age_per_command.sense) + 60;
     }},
    {"sensor_dropout", "the newest sample is older",
     [](const Seen& with, const Seen& without) {
       return p99(with.row.age_per_command.sense) > p99(without.row.age_per_command.sense) + 30;
     }},
    {"camera_freeze", "no age shows it, the error does",
     [](const Seen& with, const Seen& without) {
       return with.row.age_per_tick == without.row.age_per_tick &&
              with.row.tracking_error_rms_m > 3 * without.row.tracking_error_rms_m;
     }},
    {"sensor_lies", "no age shows it, the error does",
     [](const Seen& with, const Seen& without) {
       return !with.row.success && with.row.tracking_error_rms_m > 3 * without.row.tracking_error_rms_m &&
              p99(with.row.age_per_command.sense) <= p99(without.row.age_per_command.sense);
     }},
    {"estimator_delay", "feedback in use is older by the dose",
     [](const Seen& with, const Seen& without) {
       return with.oldest_feedback > without.oldest_feedback + milliseconds(9) && with.ticks_without_reply >= 9;
     }},
    {"inference_stall", "some inferences last longer",
     [](const Seen& with, const Seen& without) {
       return p99(with.row.age_per_tick.total) > p99(without.row.age_per_tick.total) + 300;
     }},
    {"inference_mean_shift", "inferences last several times as long",
     [](const Seen& with, const Seen& without) {
       return *with.row.age_per_command.infer.p95_ms > 3 * *without.row.age_per_command.infer.p95_ms;
     }},
    {"gpu_contention", "inferences last longer, each as its turn comes",
     [](const Seen& with, const Seen& without) {
       return *with.row.age_per_command.infer.p95_ms > 3 * *without.row.age_per_command.infer.p95_ms &&
              p99(with.row.age_per_command.infer) > 2 * *with.row.age_per_command.infer.p50_ms;
     }},
    {"queue_growth", "inference as before, but a long queue and ages past the horizon",
     [](const Seen& with, const Seen& without) {
       return std::abs(*with.row.age_per_command.infer.p50_ms - *without.row.age_per_command.infer.p50_ms) < 0.5 &&
              p99(with.row.age_per_command.queue) > 100 && p99(with.row.age_per_tick.total) > 160;
     }},
    {"publish_delay", "the publish part grows by the dose",
     [](const Seen& with, const Seen&) { return p99(with.row.age_per_command.publish) > 99; }},
    {"policy_crash", "no command for longer than stop_after: a damped stop that stays",
     [](const Seen& with, const Seen&) {
       return with.row.failure_label == "command_lost" && with.row.final_mode == Mode::damped_stop &&
              with.row.safety.entered_damped_stop == 1;
     }},
    {"policy_freeze", "one long gap, then it goes on",
     [](const Seen& with, const Seen& without) {
       return p99(with.row.age_per_tick.total) > p99(without.row.age_per_tick.total) + 250 &&
              with.row.final_mode == Mode::tracking;
     }},
    {"bad_actions_nan", "commands are refused",
     [](const Seen& with, const Seen&) { return with.last.refused_commands > 10; }},
    {"bad_actions_range", "one joint's target is clamped, and the command accepted",
     [](const Seen& with, const Seen&) {
       const auto clamped = static_cast<std::size_t>(std::countr_zero(bit(Intervention::target_range)));
       return with.last.refused_commands == 0 && with.row.interventions[clamped] > 10;
     }},
    {"wrong_joint_order", "accepted, and wrong",
     [](const Seen& with, const Seen& without) {
       return with.last.refused_commands == 0 && with.row.tracking_error_rms_m > 10 * without.row.tracking_error_rms_m;
     }},
    {"scheduler_preemption", "ticks are late and periods are lost",
     [](const Seen& with, const Seen& without) {
       return with.latest_wake >= milliseconds(8) && with.last.skipped_periods > 50 &&
              without.last.skipped_periods == 0 && with.row.ticks < without.row.ticks;
     }},
    {"cpu_hog", "twenty stops of the dose each",
     [](const Seen& with, const Seen&) {
       return with.latest_wake > milliseconds(19) && with.latest_wake < milliseconds(21) &&
              with.last.skipped_periods >= 20 * 18 && with.last.skipped_periods <= 20 * 20;
     }},
    {"rt_throttling", "two stops of the dose each",
     [](const Seen& with, const Seen&) {
       return with.latest_wake > milliseconds(49) && with.latest_wake < milliseconds(51) &&
              with.last.skipped_periods >= 2 * 48 && with.last.skipped_periods <= 2 * 50;
     }},
    {"can_loss", "replies are lost",
     [](const Seen& with, const Seen& without) { return with.replies + 200 < without.replies; }},
    {"can_delay", "nothing arrives for the dose, then everything that much later",
     [](const Seen& with, const Seen& without) {
       return with.ticks_without_reply >= 3 && without.ticks_without_reply == 0;
     }},
    {"bus_off", "a fault that stays",
     [](const Seen& with, const Seen&) {
       return with.row.failure_label == "bus_off" && with.row.final_mode == Mode::fault_latched;
     }},
    {"feedback_frozen", "a fault that stays", found_implausible},
    {"feedback_repeated", "a fault that stays", found_implausible},
    {"feedback_reversed", "a fault that stays", found_implausible},
    {"feedback_jump", "a fault that stays", found_implausible},
    {"feedback_scale", "a fault that stays", found_implausible},
    {"push", "the tool is pushed away",
     [](const Seen& with, const Seen& without) {
       return with.row.tracking_error_p95_m > 5 * without.row.tracking_error_p95_m && with.row.success;
     }},
    {"payload", "the tool sags",
     [](const Seen& with, const Seen& without) {
       return with.row.tracking_error_rms_m > 3 * without.row.tracking_error_rms_m;
     }},
    {"friction", "the arm follows less closely",
     [](const Seen& with, const Seen& without) {
       return with.row.tracking_error_rms_m > 1.3 * without.row.tracking_error_rms_m;
     }},
    {"operator_stop", "a stop at once that nobody ends",
     [](const Seen& with, const Seen& without) {
       return with.row.failure_label == "operator_stop" && with.row.safety.entered_damped_stop == 1 &&
              with.row.final_mode == Mode::damped_stop && without.row.success;
     }},
};

class EveryPerturbation : public testing::TestWithParam<Claim> {};

TEST_P(EveryPerturbation, DoesWhatItClaimsInsideItsWindowOnly) {
  const Seen with = watch(GetParam().perturbation);
  EXPECT_TRUE(GetParam().holds(with, nominal())) << GetParam().when << ", " << with.row.failure_label;
  EXPECT_NE(with.row.replay_hash, nominal().row.replay_hash);
  EXPECT_EQ(with.before, nominal().before);
}

INSTANTIATE_TEST_SUITE_P(Panel, EveryPerturbation, testing::ValuesIn(kClaims),
                         [](const auto& row) { return std::string(row.param.perturbation); });

// Goal: perturbations act together, each in its own window, whichever of them is named first. Method: lost frames from
// 2 s to 4 s and a policy that stands still at 3 s; until then lost frames alone give the same ticks, and each alone
// gives others.
TEST(Perturbation, WhatActsBesidesHasAWindowOfItsOwn) {
  const evidence::Perturbation losses{evidence::Trouble::can_loss, 0.1, seconds(2), seconds(2)},
      freeze{evidence::Trouble::policy_freeze, 400, seconds(3), seconds(1)};
  const MonoTime frozen = kWindow + seconds(1);
  struct Ran {
    evidence::RolloutRow row;
    std::vector<std::vector<char>> before;        // records before the freeze
    int frozen_commands = 0, later_commands = 0;  // published while it lasts; after it, while frames are lost
  };
  const auto ran = [&](const evidence::Perturbation& perturbation, const evidence::Perturbation* besides) {
    Ran seen;
    evidence::RolloutSetup wanted = test::setup();
    wanted.perturbation = perturbation;
    if (besides != nullptr) wanted.perturbation.with = {*besides};
    wanted.on_tick = [&](const TickRecord& record) {
      const auto* const bytes = reinterpret_cast<const char*>(&record);
      if (record.header.now < frozen) seen.before.emplace_back(bytes, bytes + record.used_bytes());
    };
    wanted.on_command = [&](const CommandChunk& chunk) {
      const Duration since = chunk.header.published_at - frozen;
      seen.frozen_commands += since >= milliseconds(5) && since < milliseconds(400) ? 1 : 0;
      seen.later_commands += since >= milliseconds(400) && since < seconds(1) ? 1 : 0;
    };
    seen.row = test::run(wanted);
    return seen;
  };
  const Ran both = ran(losses, &freeze), turned = ran(freeze, &losses), lost = ran(losses, nullptr),
            froze = ran(freeze, nullptr);
  EXPECT_EQ(both.row.replay_hash, turned.row.replay_hash);
  EXPECT_EQ(both.before, lost.before);
  EXPECT_NE(both.row.replay_hash, lost.row.replay_hash);
  EXPECT_NE(both.row.replay_hash, froze.row.replay_hash);
  EXPECT_EQ(both.frozen_commands, 0);
  EXPECT_GE(both.later_commands, 5);
}

// Goal: windows and bodies belong to their trouble, and the whole lasts from the first to the last. Method: three at
// once.
TEST(Perturbation, EachTroubleKeepsItsOwnInstants) {
  evidence::Perturbation three{evidence::Trouble::push, 30, seconds(3), seconds(2), {}, "torso"};
  three.with = {{evidence::Trouble::can_delay, 4, seconds(2), seconds(4)},
                {evidence::Trouble::bus_off, 500, seconds(1), seconds(9)}};
  const MonoTime start{1'000'000'000};
  const evidence::Disturbance seen(three, start);
  EXPECT_FALSE(seen.has(evidence::Trouble::none));
  EXPECT_FALSE(seen.has(evidence::Trouble::payload));
  EXPECT_EQ(seen.body(evidence::Trouble::push), "torso");
  EXPECT_EQ(seen.body(evidence::Trouble::payload), "");
  EXPECT_EQ(seen.dose(evidence::Trouble::push, start + milliseconds(2999)), 0);
  EXPECT_EQ(seen.dose(evidence::Trouble::push, start + seconds(3)), 30);
  EXPECT_EQ(seen.turn(evidence::Trouble::push, start + milliseconds(4500)), 2);
  EXPECT_EQ(seen.dose(evidence::Trouble::bus_off, start + milliseconds(1499)), 500);
  EXPECT_EQ(seen.dose(evidence::Trouble::bus_off, start + milliseconds(1500)), 0) << "as long as its dose";
  EXPECT_EQ(seen.delay(evidence::Trouble::can_delay, start + seconds(5)), milliseconds(4));
  EXPECT_EQ(seen.dose(evidence::Trouble::payload, start + seconds(3)), 0);
  EXPECT_EQ(seen.begins(), start + seconds(1));
  EXPECT_EQ(seen.ends(), start + seconds(6));
}

TEST(Perturbation, EveryRowOfTheTableHasAClaim) {
  for (const trouble::Row& kind : evidence::perturbation_kinds().subspan(1)) {
    EXPECT_EQ(
        std::ranges::count(kClaims, kind.name, [](const Claim& claim) { return std::string_view(claim.perturbation); }),
        1)
        << kind.name;
    EXPECT_TRUE(kind.dose.least <= kind.dose.moderate && kind.dose.moderate <= kind.dose.most) << kind.name;
  }
}

}  // namespace
}  // namespace takt::lab
