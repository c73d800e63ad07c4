// SPDX-License-Identifier: Apache-2.0
// Goal: nothing that grows while a robot runs ends its record, or its motion: the record goes on in another folder, and
// the seam costs no tick. Method: the virtual robot, told how far its record is on the medium, tracks over a hundred
// seams; each folder is read, replayed and checked against its seal, and is compared with its neighbours.
#include "monitor/record/run_parts.hpp"

#include <gtest/gtest.h>
#include <sys/mount.h>

#include <filesystem>
#include <set>

#include "evidence/review/replay.hpp"
#include "evidence/review/report/report_text.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/frame_log.hpp"
#include "monitor/record/run_seal.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

class RunPartsTest : public test::TemporaryFolder {
 protected:
  void start(std::uint64_t part_bytes, const std::string& name = "run", Duration longest_part = kLongestPart) {
    auto started = RunParts::start(RunFolder::create(path(name)).value(), robot_.manifest(), demo_robot(), part_bytes,
                                   longest_part);
    ASSERT_TRUE(started) << started.error();
    parts_ = std::move(*started);
    stream_.emplace(RecordStream::attach(robot_.rings(), demo_robot().joints.size()).value());
    robot_.spoil_input = [this](pipeline::TickInput& input) { input.recorded_through = parts_->written_through(); };
  }
  // In steps of 20 ticks, as the monitor drains the rings.
  void record(std::uint64_t ticks) {
    for (std::uint64_t tick = 0; tick < ticks; tick += 20) {
      robot_.run(20);
      stream_->drain(parts_->sink(), false);
      if (each_drain) each_drain();
      parts_->flush_if_due(robot_.latest().header.now);
      for (std::string& closed : parts_->take_closed()) folders_.push_back(std::move(closed));
    }
  }
  void finish() {
    stream_->drain(parts_->sink(), true);
    const auto done = parts_->finish(robot_.latest().header.now, "test over");
    ASSERT_TRUE(done) << done.error();
    for (std::string& closed : parts_->take_closed()) folders_.push_back(std::move(closed));
    folders_.push_back(parts_->folder().path());
  }
  RecordedRun part(std::size_t index) {
    auto run = open_run(folders_.at(index));
    if (!run) throw std::runtime_error(run.error());
    return *run;
  }

  VirtualRobot robot_;
  std::unique_ptr<RunParts> parts_;
  std::optional<RecordStream> stream_;
  std::vector<std::string> folders_;  // of the parts, in order
  std::function<void()> each_drain;
};

struct Ends {
  std::uint64_t first = 0, last = 0, ticks = 0, commands = 0;
  RecordedKeyframe first_keyframe{}, last_keyframe{};
};
Ends ends_of(const RecordedRun& run) {
  Ends ends;
  const auto scan = scan_run(run, {.tick =
                                       [&](const RecordedTick& tick) {
                                         ends.last = tick.record.header.tick;
                                         if (ends.ticks++ == 0) ends.first = ends.last;
                                       },
                                   .command = [&](const RecordedCommand&) { ++ends.commands; },
                                   .keyframe =
                                       [&](const RecordedKeyframe& keyframe) {
                                         if (ends.first_keyframe.tick == 0) ends.first_keyframe = keyframe;
                                         ends.last_keyframe = keyframe;
                                       },
                                   .loss = [](const Loss& loss) { ADD_FAILURE() << loss.ring << ' ' << loss.reason; }});
  EXPECT_TRUE(scan);
  return ends;
}

TEST_F(RunPartsTest, AHundredSeamsWhileTrackingCostNothing) {
  constexpr std::uint64_t kSeams = 100, kTicks = (kSeams + 5) * VirtualRobot::kKeyframeEvery + 100;
  start(1);  // every keyframe is a seam
  record(kTicks);
  EXPECT_EQ(robot_.latest().header.mode, Mode::tracking) << "no seam stopped the robot";
  finish();
  ASSERT_GT(folders_.size(), kSeams);
  std::uint64_t identical = 0, frames = 0, seams_in_tracking = 0, stops = 0;
  Ends before;
  for (std::size_t i = 0; i < folders_.size(); ++i) {
    const RecordedRun run = part(i);
    const Ends ends = ends_of(run);
    const std::string& folder = folders_[i];
    EXPECT_TRUE(run.manifest.complete) << folder;
    EXPECT_EQ(run.manifest.goes_on_from, i == 0 ? "" : part(i - 1).manifest.run_id);
    EXPECT_EQ(run.manifest.goes_on_in, i + 1 == folders_.size() ? "" : RunFolder(folders_[i + 1]).name());
    EXPECT_EQ(ends.first, before.last + 1) << folder << ": no tick is lost, and none is there twice";
    EXPECT_EQ(ends.ticks, ends.last - ends.first + 1) << folder;
    if (i != 0) {
      EXPECT_EQ(ends.first_keyframe.tick, before.last) << folder;
      EXPECT_EQ(ends.first_keyframe.state, before.last_keyframe.state) << "both sides of the seam know the same state";
    }
    const auto replayed = evidence::replay(run, 1);
    ASSERT_TRUE(replayed) << replayed.error();
    EXPECT_EQ(replayed->identical, ends.ticks) << evidence::replay_text(*replayed);
    EXPECT_TRUE(replayed->is_whole() && replayed->reproduces()) << evidence::replay_text(*replayed);
    identical += replayed->identical;
    const auto seal = check_run_seal(run.folder);
    ASSERT_TRUE(seal) << seal.error();
    EXPECT_TRUE(seal->closed);
    EXPECT_EQ(seal->altered, std::vector<std::string>{});
    const auto metrics = metrics_of(run);
    ASSERT_TRUE(metrics);
    EXPECT_EQ(metrics->record_gap, "") << "a part is a whole record";
    stops += metrics->incidents.size();
    if (metrics->last_mode == Mode::tracking) ++seams_in_tracking;
    const std::string lines = read_frame_log(run.folder).value();
    frames += static_cast<std::uint64_t>(std::ranges::count(lines, '\n'));
    before = ends;
  }
  EXPECT_EQ(identical, kTicks);
  EXPECT_EQ(frames, kTicks) << "one frame a tick";
  EXPECT_GE(seams_in_tracking, kSeams);
  EXPECT_EQ(stops, 0U);
  const RecordedRun middle = part(50);
  const std::string seal = read_file(part(49).folder.seal()).value();
  ASSERT_TRUE(replace_file(part(49).folder.seal(), read_file(part(48).folder.seal()).value()));
  EXPECT_EQ(check_run_seal(middle.folder)->altered,
            std::vector<std::string>{"run.50, the part before it, has another seal than it had"});
  EXPECT_EQ(check_run_seal(RunFolder(middle.folder.path() + "/"))->altered.size(), 1U) << "as a shell completes it";
  ASSERT_TRUE(replace_file(part(49).folder.seal(), seal));
  EXPECT_EQ(check_run_seal(middle.folder)->altered, std::vector<std::string>{});
  EXPECT_NE(
      evidence::report_text(*metrics_of(middle), middle).find("part          goes on from run.50, goes on in run.52\n"),
      std::string::npos)
      << evidence::report_text(*metrics_of(middle), middle);
}

// Goal: a record that grows slowly goes on in parts, too: what its index and its seal hold in memory has an end.
// Method: parts of three seconds, none of which comes near its size.
TEST_F(RunPartsTest, APartEndsAfterItsTimeWhateverItsSize) {
  start(kDefaultPartBytes, "run", seconds(3));
  record(10'000);
  finish();
  ASSERT_GE(folders_.size(), 3U);
  std::uint64_t newest = 0;
  for (std::size_t i = 0; i < folders_.size(); ++i) {
    const Ends ends = ends_of(part(i));
    EXPECT_EQ(ends.first, newest + 1);
    if (i + 1 < folders_.size()) {
      EXPECT_GE(ends.ticks, 2'900U) << folders_[i];
      EXPECT_LE(ends.ticks, 3'100U + VirtualRobot::kKeyframeEvery) << folders_[i];
    }
    newest = ends.last;
  }
  EXPECT_EQ(newest, 10'000U);
}

// Goal: where no folder can be made, the record takes more where it is, and says why. Method: a folder whose successors
// have names that are longer than a file system takes.
TEST_F(RunPartsTest, WithoutANextFolderItGoesOnWhereItIs) {
  start(1, std::string(254, 'r'));
  record(2'000);
  EXPECT_NE(parts_->failure().find("File name too long"), std::string::npos) << parts_->failure();
  EXPECT_EQ(robot_.latest().header.mode, Mode::tracking);
  finish();
  ASSERT_EQ(folders_.size(), 1U);
  const RecordedRun run = part(0);
  EXPECT_TRUE(run.manifest.complete);
  EXPECT_EQ(ends_of(run).ticks, 2'000U);
}

// The review of a closed part writes and renames files meanwhile: then once more.
void copy_folder(const std::string& from, const std::string& to) {
  std::error_code error;
  for (int tries = 0; tries < 100; ++tries) {
    std::filesystem::remove_all(to);
    std::filesystem::copy(from, to, std::filesystem::copy_options::recursive, error);
    if (!error) return;
  }
  ADD_FAILURE() << from << ": " << error.message();
}

// Goal: a monitor that is killed at a seam, by SIGKILL or by the power, leaves runs that read and replay. Method: a
// copy of the folders as they are when the next part has begun and the one before is not closed, and after each drain
// then.
TEST_F(RunPartsTest, WhatAKillLeavesAtASeamReads) {
  start(150'000);
  std::vector<std::string> copies;
  each_drain = [&] {
    const std::string& newest = parts_->folder().path();
    if (!newest.ends_with(".3") || copies.size() == 4) return;
    copies.push_back(path("killed" + std::to_string(copies.size())));
    std::filesystem::create_directory(copies.back());
    for (const char* const name : {"run", "run.2", "run.3"}) copy_folder(path(name), copies.back() + "/" + name);
    parts_->flush_if_due(robot_.latest().header.now);
  };
  while (copies.size() < 4 && robot_.latest().header.tick < 20'000) record(20);
  finish();
  ASSERT_EQ(copies.size(), 4U);
  for (const std::string& copy : copies) {
    std::uint64_t newest = 0;
    for (const char* const name : {"/run", "/run.2", "/run.3"}) {
      const auto run = open_run(copy + name);
      ASSERT_TRUE(run) << run.error();
      const Ends ends = ends_of(*run);
      EXPECT_TRUE(ends.ticks == 0 || ends.first == newest + 1) << copy << name;
      newest = std::max(newest, ends.last);
      if (const auto seal = check_run_seal(run->folder)) {
        EXPECT_EQ(seal->altered, std::vector<std::string>{}) << copy << name;
      }
      if (ends.ticks == 0) continue;
      const auto replayed = evidence::replay(*run, 1);
      ASSERT_TRUE(replayed) << replayed.error();
      EXPECT_EQ(replayed->identical, ends.ticks) << evidence::replay_text(*replayed);
      EXPECT_TRUE(metrics_of(*run)) << copy << name;
    }
    EXPECT_EQ(open_run(copy + "/run.3")->manifest.goes_on_from, "run.2");
  }
}

// Goal: a disk that fills up behind a seam ends the record with the last tick on it, and what was closed before is
// whole. Method: a disk of 5 MiB, with seams until it is full.
TEST_F(RunPartsTest, AFullDiskEndsTheNewestPart) {
  const std::string disk = path("disk");
  std::filesystem::create_directory(disk);
  if (::mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=5m") != 0) GTEST_SKIP() << "SKIPPED: may not mount a tmpfs";
  {
    start(400'000, "disk/run");
    while (parts_->stop_reason().empty() && robot_.latest().header.tick < 60'000) record(20);
    EXPECT_NE(parts_->stop_reason().find("No space left"), std::string::npos) << parts_->stop_reason();
    EXPECT_EQ(parts_->written_through(), 0U);
    record(400);  // stays, and counts
    stream_->drain(parts_->sink(), true);
    (void)parts_->finish(robot_.latest().header.now, "test over");
    for (std::string& closed : parts_->take_closed()) folders_.push_back(std::move(closed));
    folders_.push_back(parts_->folder().path());
    ASSERT_GE(folders_.size(), 3U);
    for (std::size_t i = 0; i < folders_.size(); ++i) {
      const RecordedRun run = part(i);
      std::uint64_t ticks = 0;
      ASSERT_TRUE(
          scan_run(run, {.tick = [&](const RecordedTick&) { ++ticks; }, .command = {}, .keyframe = {}, .loss = {}}));
      EXPECT_EQ(evidence::replay(run, 1)->identical, ticks);
      EXPECT_EQ(run.manifest.ticks, ticks);
      if (i + 1 < folders_.size()) {
        EXPECT_EQ(run.manifest.goes_on_in, RunFolder(folders_[i + 1]).name());
      } else {
        EXPECT_FALSE(run.manifest.complete);
        EXPECT_EQ(run.manifest.stopped_because, parts_->stop_reason());
        EXPECT_GE(run.manifest.unrecorded_ticks, 400U);
      }
    }
    parts_.reset();
  }
  EXPECT_EQ(::umount(disk.c_str()), 0);
}

// Goal: a robot that stands by fills little, loses nothing that tells, and its record is exact where it is kept.
// Method: standby of 23 s, then arming in the middle between two keyframes; in one part, and with a seam at every
// keyframe.
class Standby : public RunPartsTest, public testing::WithParamInterface<std::uint64_t> {};

TEST_P(Standby, OneTickInTwentyIsKeptAndReplaysExactly) {
  constexpr std::uint64_t kTicks = 25'000, kQuiet = 5'200, kArmAt = 23'457, kBefore = 23'400;
  robot_.arm_at = kArmAt;
  start(GetParam());
  std::uint64_t inputs = 0;
  each_drain = [&] {
    RecordedPolicyInput input;
    input.input.header.observation_id = ++inputs;
    input.crc = crc_of(input.input);
    parts_->sink().policy_input(input);
  };
  record(kTicks);
  EXPECT_EQ(robot_.latest().header.mode, Mode::tracking) << "what is held back counts as recorded in time";
  finish();
  std::set<std::uint64_t> kept;
  std::uint64_t stood_by = 0, frames = 0, inputs_left_out = 0, inputs_kept = 0;
  for (std::size_t i = 0; i < folders_.size(); ++i) {
    const RecordedRun run = part(i);
    std::uint64_t here = 0;
    ASSERT_TRUE(scan_run(run, {.tick =
                                   [&](const RecordedTick& tick) {
                                     ++here;
                                     EXPECT_TRUE(kept.insert(tick.record.header.tick).second);
                                   },
                               .command = {},
                               .keyframe = {},
                               .loss =
                                   [&](const Loss& loss) {
                                     EXPECT_EQ(loss.reason, kStoodBy);
                                     if (loss.ring == "policy_input") inputs_left_out += loss.count;
                                   },
                               .policy_input = [&](const RecordedPolicyInput&) { ++inputs_kept; }}));
    const auto replayed = evidence::replay(run, 1);
    ASSERT_TRUE(replayed) << replayed.error();
    EXPECT_EQ(replayed->identical, here) << evidence::replay_text(*replayed);
    EXPECT_TRUE(replayed->is_whole()) << evidence::replay_text(*replayed);
    EXPECT_EQ(replayed->gaps, 0U);
    const auto metrics = metrics_of(run);
    ASSERT_TRUE(metrics);
    EXPECT_EQ(metrics->record_gap, "") << run.folder.path();
    EXPECT_EQ(metrics->missing_ticks, 0U);
    EXPECT_TRUE(metrics->losses.empty() && run.manifest.losses.empty());
    EXPECT_EQ(metrics->stood_by_ticks, run.manifest.stood_by_ticks);
    EXPECT_EQ(evidence::report_text(*metrics, run).find("standby       one tick in 20 kept; ") != std::string::npos,
              metrics->stood_by_ticks != 0);
    stood_by += metrics->stood_by_ticks;
    frames += static_cast<std::uint64_t>(std::ranges::count(read_frame_log(run.folder).value(), '\n'));
  }
  EXPECT_EQ(kept.size() + stood_by, kTicks) << "each tick is there, or was left out";
  EXPECT_GE(frames, kept.size()) << "a kept tick's frames are kept";
  EXPECT_LE(frames, kept.size() + 20) << "of the others those only that a drain of the rings told before quiet began";
  for (std::uint64_t tick = 1; tick <= kTicks; ++tick)
    EXPECT_TRUE((tick > kQuiet - 200 && tick <= kBefore) || kept.contains(tick)) << tick;
  EXPECT_LT(kept.size(), kQuiet + (kBefore - kQuiet) / 19 + (kTicks - kBefore));
  EXPECT_GT(inputs_left_out, 500U);
  EXPECT_GE(inputs_left_out + inputs_kept, inputs);
}
INSTANTIATE_TEST_SUITE_P(Parts, Standby, testing::Values(1U, 1U << 30U),
                         [](const auto& row) { return row.param == 1 ? "Many" : "One"; });

// Goal: what a policy was shown for a command is in the command's part, on whichever side of the seam it was told.
// Method: an input in each drain, with the number of the newest tick; each part has those of its ticks.
TEST_F(RunPartsTest, AnInputIsOnBothSidesOfASeam) {
  start(1);
  each_drain = [&] {
    RecordedPolicyInput input;
    input.input.header.observation_id = robot_.latest().header.tick;
    input.crc = crc_of(input.input);
    parts_->sink().policy_input(input);
  };
  record(2'100);
  finish();
  ASSERT_GE(folders_.size(), 5U);
  for (std::size_t i = 0; i + 1 < folders_.size(); ++i) {
    const RecordedRun run = part(i);
    std::set<std::uint64_t> inputs;
    ASSERT_TRUE(scan_run(
        run,
        {.tick = {}, .command = {}, .keyframe = {}, .loss = {}, .policy_input = [&](const RecordedPolicyInput& input) {
           inputs.insert(input.input.header.observation_id);
         }}));
    for (std::uint64_t tick = run.manifest.first_tick + 19; tick <= run.manifest.last_tick + 20; ++tick)
      EXPECT_TRUE(tick % 20 != 0 || inputs.contains(tick)) << run.manifest.run_id << " lacks " << tick;
  }
}

}  // namespace
}  // namespace takt::monitor
