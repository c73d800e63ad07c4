// SPDX-License-Identifier: Apache-2.0
// Goal: a recorded run reproduces bit for bit, and nothing that was changed in it goes unnoticed or unnamed.
// Method: a run recorded in virtual time, replayed as it is, from the middle, with ticks missing, and with one bit of
// one field flipped, for fields the decision depends on and fields it does not.
#include "evidence/review/replay.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <limits>

#include "executive/contract/version.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

float flip(float value, int bit) {
  return std::bit_cast<float>(std::bit_cast<std::uint32_t>(value) ^ (1U << bit));
}

class ReplayTest : public test::TemporaryFolder {
 protected:
  static void leave(TickRecord&) {}
  static void leave_command(RecordedCommand&) {}
  static bool keep(std::uint64_t) { return true; }

  evidence::ReplayReport replay_altered(const std::function<void(TickRecord&)>& alter) {
    const auto report =
        evidence::replay(altered_copy(run_, path(std::to_string(++copies_)), alter, leave_command, keep), 1);
    EXPECT_TRUE(report) << report.error();
    return report ? *report : evidence::ReplayReport{};
  }
  const RecordedRun run_ = record_demo(path("run"));
  int copies_ = 0;
};

TEST_F(ReplayTest, EveryTickReproducesBitForBit) {
  const auto report = evidence::replay(run_, 1);
  ASSERT_TRUE(report) << report.error();
  EXPECT_TRUE(report->reproduces()) << evidence::replay_text(*report);
  EXPECT_EQ(report->ticks, kDemoTicks);
  EXPECT_EQ(report->identical, kDemoTicks);
  EXPECT_EQ(report->not_judged, 0U);
  EXPECT_TRUE(report->is_whole());
  EXPECT_EQ(report->keyframes, kDemoTicks / VirtualRobot::kKeyframeEvery);
  EXPECT_EQ(evidence::replay_text(*report).substr(0, 45), "4000 of 4000 ticks reproduce bit for bit; 20 ");
}

// What an older build recorded may come out otherwise for its sake: who reads the report knows.
TEST_F(ReplayTest, ARunOfOtherSourcesIsNamedAsSuch) {
  RecordedRun run = run_;
  run.manifest.executive = {{"version", "0.1.0+git7.0123456789ab"}, {"source_sha256", std::string(64, 'a')}};
  const auto other = evidence::replay(run, 1);
  ASSERT_TRUE(other) << other.error();
  EXPECT_TRUE(other->reproduces());
  EXPECT_NE(evidence::replay_text(*other).find("\ntakt 0.1.0+git7.0123456789ab made it, of other sources than "),
            std::string::npos);
  EXPECT_EQ(to_json(*other)["made_by_other_sources"], "0.1.0+git7.0123456789ab");
  run.manifest.executive["source_sha256"] = source_sha256();
  const auto same = evidence::replay(run, 1);
  ASSERT_TRUE(same) << same.error();
  EXPECT_EQ(same->made_by, "");
  EXPECT_TRUE(to_json(*same)["made_by_other_sources"].is_null());
}

TEST_F(ReplayTest, StartsAtTheLastKeyframeBeforeATick) {
  const auto report = evidence::replay(run_, 2'345);
  ASSERT_TRUE(report) << report.error();
  EXPECT_TRUE(report->reproduces()) << evidence::replay_text(*report);
  EXPECT_EQ(report->started_at, 2'345U);
  EXPECT_EQ(report->identical, kDemoTicks - 2'344);
}

// One bit of one recorded input, whether the decision depends on it (q, received_at) or not (temperature,
// last_duration).
TEST_F(ReplayTest, OneFlippedBitNamesTickAndField) {
  struct Case {
    const char* field;
    const char* where;
    void (*alter)(TickRecord&);
  };
  const Case cases[] = {
      {"feedback_q", "elbow", [](TickRecord& r) { r.joints[2].feedback.q = flip(r.joints[2].feedback.q, 0); }},
      {"feedback_q", "base_yaw", [](TickRecord& r) { r.joints[0].feedback.q = flip(r.joints[0].feedback.q, 31); }},
      {"feedback_temperature", "wrist_yaw",
       [](TickRecord& r) { r.joints[5].feedback.temperature_C = flip(r.joints[5].feedback.temperature_C, 20); }},
      {"feedback_received_at", "shoulder", [](TickRecord& r) { r.joints[1].feedback.received_at.ns ^= 1; }},
      {"feedback_drive_state", "wrist_roll",
       [](TickRecord& r) { r.joints[3].feedback.drive_state = DriveState::fault; }},
      {"bus_tx_dropped", "can1", [](TickRecord& r) { r.header.buses[1].tx_dropped ^= 4; }},
      {"now", "", [](TickRecord& r) { r.header.now.ns ^= 1 << 10; }},
      {"last_duration", "", [](TickRecord& r) { r.header.last_duration.ns ^= 1; }},
      {"operator_request", "", [](TickRecord& r) { r.header.operator_request = OperatorRequest::stop; }},
      {"tau_command", "wrist_pitch", [](TickRecord& r) { r.joints[4].tau_command = flip(r.joints[4].tau_command, 3); }},
  };
  constexpr std::uint64_t at = 1'234;
  for (const Case& each : cases) {
    const evidence::ReplayReport report = replay_altered([&](TickRecord& record) {
      if (record.header.tick == at) each.alter(record);
    });
    EXPECT_FALSE(report.reproduces()) << each.field;
    ASSERT_TRUE(report.first) << each.field;
    EXPECT_EQ(report.first->tick, at) << each.field;
    EXPECT_EQ(report.first->field, each.field);
    EXPECT_EQ(report.first->where, each.where) << each.field;
    EXPECT_TRUE(report.first->altered) << each.field;
    EXPECT_NE(report.first->recorded, report.first->recomputed) << each.field;
    EXPECT_EQ(report.mismatches, 1U) << each.field;
    EXPECT_EQ(report.identical, kDemoTicks - 1) << each.field;
  }
}

TEST_F(ReplayTest, AFlippedBitInACommandIsNamed) {
  std::uint64_t altered_tick = 0;
  const auto alter = [&](RecordedCommand& command) {
    if (altered_tick != 0 || command.tick < 700) return;
    altered_tick = command.tick;
    command.payload[sizeof(CommandHeader) + 4 * 7] ^= std::byte{1};
  };
  const auto report = evidence::replay(altered_copy(run_, path("altered"), leave, alter, keep), 1);
  ASSERT_TRUE(report) << report.error();
  ASSERT_TRUE(report->first);
  EXPECT_EQ(report->first->tick, altered_tick);
  EXPECT_EQ(report->first->field, "command values[7]");
  EXPECT_EQ(report->mismatches, 1U);
}

// More than a bit: the checksum says that something is wrong, the decision says where.
TEST_F(ReplayTest, AForgedInputIsFoundByTheDecisionItself) {
  const evidence::ReplayReport report = replay_altered([](TickRecord& record) {
    if (record.header.tick == 1'010) record.joints[1].feedback.q += 0.0123F;
  });
  ASSERT_TRUE(report.first);
  EXPECT_EQ(report.first->tick, 1'010U);
  EXPECT_EQ(report.first->field, "q_estimate");
  EXPECT_EQ(report.first->where, "shoulder");
  EXPECT_GT(report.mismatches, 0U);
  EXPECT_GT(report.not_judged, 0U) << "until the next keyframe the state is unknown";
}

TEST_F(ReplayTest, BehindAGapItStartsAgainAtTheNextKeyframe) {
  const auto gone = [](std::uint64_t tick) { return tick < 1'050 || tick > 1'060; };
  const auto report = evidence::replay(altered_copy(run_, path("gap"), leave, leave_command, gone), 1);
  ASSERT_TRUE(report) << report.error();
  EXPECT_TRUE(report->reproduces()) << evidence::replay_text(*report);
  EXPECT_EQ(report->gaps, 1U);
  EXPECT_EQ(report->not_judged, 1'200U - 1'060U);
  EXPECT_EQ(report->identical, kDemoTicks - 11 - 140);
}

// A file that was closed properly, of which the end was taken away since: what is there reproduces, and is not all.
TEST_F(ReplayTest, AFileThatEndsBeforeItsManifestIsNotWhole) {
  const auto early = [](std::uint64_t tick) { return tick <= 3'000; };
  const RecordedRun cut = altered_copy(run_, path("cut"), leave, leave_command, early);
  for (const std::uint64_t from : {1U, 2'345U}) {
    const auto report = evidence::replay(cut, from);
    ASSERT_TRUE(report) << report.error();
    EXPECT_TRUE(report->reproduces()) << evidence::replay_text(*report);
    EXPECT_EQ(report->missing, kDemoTicks - 3'000);
    EXPECT_FALSE(report->is_whole());
    EXPECT_NE(evidence::replay_text(*report).find("1000 ticks are missing"), std::string::npos)
        << evidence::replay_text(*report);
    EXPECT_EQ(to_json(*report).at("missing"), kDemoTicks - 3'000);
  }
}

// Exactly from one keyframe to the next: the state is known again with the first tick behind it.
TEST_F(ReplayTest, TicksTakenOutBetweenTwoKeyframesAreMissed) {
  const auto gone = [](std::uint64_t tick) { return tick <= 1'000 || tick > 1'200; };
  const auto report = evidence::replay(altered_copy(run_, path("hole"), leave, leave_command, gone), 1);
  ASSERT_TRUE(report) << report.error();
  EXPECT_TRUE(report->reproduces()) << evidence::replay_text(*report);
  EXPECT_EQ(report->not_judged, 0U);
  EXPECT_EQ(report->missing, 200U);
  EXPECT_FALSE(report->is_whole());
}

// A full disk, or a limit, ended the recording before the robot: what is there reproduces, and is not all.
TEST_F(ReplayTest, TicksThatWereNotRecordedAreSaid) {
  RecordedRun stopped = run_;
  stopped.manifest.unrecorded_ticks = 4'225;
  stopped.manifest.stopped_because = "No space left on device";
  const auto report = evidence::replay(stopped, 1);
  ASSERT_TRUE(report) << report.error();
  EXPECT_TRUE(report->reproduces());
  EXPECT_FALSE(report->is_whole());
  EXPECT_NE(evidence::replay_text(*report).find(
                "4225 ticks are not in this folder: recording stopped: No space left on device"),
            std::string::npos);
  EXPECT_EQ(to_json(*report).at("unrecorded"), 4'225);
}

// The manifest of a recording that was cut off is older than what is in its file.
TEST_F(ReplayTest, AManifestThatSaysOfFewerTicksMissesNone) {
  RecordedRun cut_off = run_;
  cut_off.manifest.complete = false;
  cut_off.manifest.ticks = 0;
  const auto report = evidence::replay(cut_off, 1);
  ASSERT_TRUE(report) << report.error();
  EXPECT_TRUE(report->is_whole());
}

// Every kind of refusal, each recorded by its header: the ticks that read them reproduce like any other.
TEST_F(ReplayTest, RefusedMessagesReproduceFromTheirHeaders) {
  VirtualRobot robot;
  robot.cuts_what_is_refused = true;
  std::uint64_t answers = 0;
  robot.spoil_answer = [&](CommandChunk& chunk) {
    switch (++answers % 8) {
      case 1:
        chunk.values[5] = std::numeric_limits<float>::quiet_NaN();
        return;
      case 2:
        chunk.values[chunk.value_count() - 1] = 100.0F;
        return;
      case 3:
        chunk.header.outside_sensed_at = chunk.header.published_at - seconds(5);  // too old, its values are in order
        return;
      case 4:
        chunk.header.step_count = 0;
        return;
      case 5:
        chunk.header.observation_id += 1000;
        return;
      case 6:
        chunk.header.sequence = 1;
        return;
      default:
        return;
    }
  };
  const RecordedRun run = record(robot, path("refused"), 2'000, [](std::uint64_t) {});
  const auto report = evidence::replay(run, 1);
  ASSERT_TRUE(report) << report.error();
  EXPECT_TRUE(report->reproduces()) << evidence::replay_text(*report);
  EXPECT_EQ(report->identical, 2'000U);
  EXPECT_GT(report->by_header, 40U);
  EXPECT_NE(evidence::replay_text(*report).find(" refused messages were kept by their header"), std::string::npos);
}

// A configuration that is not the run's is refused before anything is compared.
TEST_F(ReplayTest, AnAlteredConfigurationIsRefused) {
  std::FILE* file = std::fopen(run_.folder.config().c_str(), "a");
  ASSERT_NE(file, nullptr);
  std::fputs("# altered\n", file);
  std::fclose(file);
  const auto opened = open_run(run_.folder.path());
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().find("was altered"), std::string::npos) << opened.error();
}

}  // namespace
}  // namespace takt::monitor
