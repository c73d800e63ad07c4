// SPDX-License-Identifier: Apache-2.0
// Goal: whatever happens to the monitor or its disk, what was recorded is right, and what was not is declared.
// Method: the virtual robot's rings, drained at different paces; files that stop growing; a medium that refuses at
// write-back what a file took (this program's own fdatasync); folders that exist already.
#include "monitor/record/recorder.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>

#include "evidence/review/replay.hpp"
#include "evidence/review/report/report_text.hpp"
#include "monitor/record/candump.hpp"
#include "monitor/record/frame_log.hpp"
#include "monitor/record/run_seal.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace {

// Whose pages the medium refuses, and how often it still takes them before.
std::string refused_file;  // empty: none
int taken_before = 0;

}  // namespace

extern "C" int fdatasync(int fd) {
  std::error_code error;
  const auto file = std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(fd), error);
  if (!refused_file.empty() && file.filename() == refused_file && taken_before-- <= 0) {
    errno = EIO;
    return -1;
  }
  return static_cast<int>(syscall(SYS_fdatasync, fd));
}

namespace takt::monitor {
namespace {

class RecorderTest : public test::TemporaryFolder {
 protected:
  ~RecorderTest() override { refused_file.clear(); }
  std::unique_ptr<Recorder> start(const std::string& directory, std::uint64_t max_file_bytes = 1U << 30U) {
    const auto folder = RunFolder::create(directory);
    EXPECT_TRUE(folder) << folder.error();
    auto recorder = Recorder::start(*folder, robot_.manifest(), demo_robot(), max_file_bytes);
    EXPECT_TRUE(recorder) << recorder.error();
    return recorder ? std::move(*recorder) : nullptr;
  }
  RecordStream attach() { return RecordStream::attach(robot_.rings(), demo_robot().joints.size()).value(); }

  // Runs and drains in steps of 50 ticks.
  void record(RecordStream& stream, Recorder& recorder, std::uint64_t ticks) {
    for (std::uint64_t tick = 0; tick < ticks; tick += 50) {
      robot_.run(50);
      stream.drain(recorder.sink(), false);
      recorder.flush_if_due(robot_.latest().header.now);
    }
  }
  void finish(RecordStream& stream, Recorder& recorder) {
    stream.drain(recorder.sink(), true);
    const auto done = recorder.finish(robot_.latest().header.now, "test over");
    EXPECT_TRUE(done) << done.error();
  }
  static RecordedRun opened(const std::string& directory) {
    auto run = open_run(directory);
    if (!run) throw std::runtime_error(run.error());
    // However recording ended: a full disk and a medium that refuses cut files back under the seal.
    const auto seal = check_run_seal(run->folder);
    EXPECT_TRUE(seal || !run->manifest.ended_at.is_set()) << seal.error();
    if (seal) {
      EXPECT_EQ(seal->altered, std::vector<std::string>{});
    }
    return *run;
  }
  static std::vector<std::uint64_t> ticks_in(const RecordedRun& run) {
    std::vector<std::uint64_t> ticks;
    (void)scan_run(run, {.tick = [&](const RecordedTick& tick) { ticks.push_back(tick.record.header.tick); },
                         .command = {},
                         .keyframe = {},
                         .loss = {}});
    return ticks;
  }
  // Stops recording by whatever limit is in force, and checks that everything about it is declared.
  void expect_declared_stop(const std::string& directory, Recorder& recorder, RecordStream& stream) {
    record(stream, recorder, 3'000);
    EXPECT_NE(recorder.stop_reason(), "");
    record(stream, recorder, 500);  // stays alive, goes on counting
    finish(stream, recorder);
    const RecordedRun run = opened(directory);
    EXPECT_FALSE(run.manifest.complete);
    EXPECT_EQ(run.manifest.stopped_because, recorder.stop_reason());
    const auto ticks = ticks_in(run);
    ASSERT_FALSE(ticks.empty());
    EXPECT_EQ(run.manifest.ticks, ticks.size());
    EXPECT_EQ(run.manifest.last_tick, ticks.back());
    EXPECT_EQ(run.manifest.ticks + run.manifest.unrecorded_ticks, 3'500U);
    EXPECT_TRUE(std::any_of(run.manifest.first_losses.begin(), run.manifest.first_losses.end(), [&](const Loss& loss) {
      return loss.reason == "recording_stopped" && loss.after_tick == ticks.back();
    }));
    const auto report = evidence::replay(run, 1);
    ASSERT_TRUE(report);
    EXPECT_EQ(report->identical, ticks.size()) << "what is there still reproduces";
  }

  VirtualRobot robot_;
};

// What the executive is told: nothing before the medium has something, which it has as soon as there are ticks; no tick
// that is not there; nothing any more once recording stopped.
TEST_F(RecorderTest, ItSaysHowFarTheMediumHasTheRun) {
  auto recorder = start(path("run"), 200'000);
  auto stream = attach();
  EXPECT_EQ(recorder->written_through(), 0U);
  record(stream, *recorder, 50);
  const std::uint64_t first = recorder->written_through();
  EXPECT_GT(first, 0U);
  record(stream, *recorder, 50);
  EXPECT_EQ(recorder->written_through(), first) << "half a second has not passed";
  record(stream, *recorder, 600);
  EXPECT_GT(recorder->written_through(), first + 400);
  EXPECT_LE(recorder->written_through(), robot_.latest().header.tick);
  record(stream, *recorder, 5'000);
  ASSERT_FALSE(recorder->stop_reason().empty()) << "the file was to reach its limit";
  EXPECT_EQ(recorder->written_through(), 0U);
}

TEST_F(RecorderTest, AnUndisturbedRunIsWholeAndSaysSo) {
  auto stream = attach();
  const auto recorder = start(path("run"));
  EXPECT_FALSE(opened(path("run")).manifest.complete) << "a run that is going on is not complete";
  record(stream, *recorder, 2'000);
  finish(stream, *recorder);
  const RecordedRun run = opened(path("run"));
  EXPECT_TRUE(run.manifest.complete);
  EXPECT_EQ(run.manifest.ticks, 2'000U);
  EXPECT_TRUE(run.manifest.losses.empty());
  ASSERT_EQ(run.manifest.watchdog_waivers.size(), 1U);
  EXPECT_EQ(run.manifest.watchdog_waivers[0].joint, "elbow");
  EXPECT_EQ(run.manifest.watchdog_waivers[0].reason, "seen to stop");
  EXPECT_EQ(run.robot.sha256, demo_robot().sha256) << "the recorded configuration is the robot's";
  EXPECT_FALSE(std::filesystem::exists(run.folder.reserve()));

  // transitions.jsonl tells what the ticks tell.
  const auto metrics = metrics_of(run);
  ASSERT_TRUE(metrics);
  std::ifstream lines(run.folder.transitions());
  std::size_t count = 0;
  for (std::string line; std::getline(lines, line); ++count) {
    const auto json = nlohmann::json::parse(line);
    ASSERT_LT(count, metrics->transitions.size());
    EXPECT_EQ(json.at("tick"), metrics->transitions[count].tick);
    EXPECT_EQ(json.at("cause"), name(metrics->transitions[count].cause));
  }
  EXPECT_EQ(count, metrics->transition_count);

  // Every line of can.log.zst is candump's, at the tick's Unix time.
  std::istringstream log(read_frame_log(run.folder).value());
  std::size_t frames = 0;
  for (std::string line; std::getline(log, line); ++frames) {
    const auto frame = parse_candump_line(line);
    ASSERT_TRUE(frame) << frame.error();
    EXPECT_EQ(frame->interface, "can0");
    EXPECT_EQ(frame->frame.id, 0x123U);
  }
  EXPECT_EQ(frames, 2'000U);
}

std::string drive_cards(const std::string& config_sha256, const std::string& firmware) {
  const nlohmann::ordered_json told{
      {"fact", "firmware"}, {"value", firmware}, {"expected", "5013"}, {"verdict", "differs"}},
      agreed{{"fact", "mode"}, {"value", "1 (MIT)"}, {"verdict", "agrees"}},
      untold{{"fact", "home"}, {"value", nullptr}, {"verdict", "unknown"}};
  nlohmann::ordered_json drive{{"joint", "elbow"}, {"protocol", "mit"}, {"watchdog_waiver", "seen to stop"}};
  drive["facts"] = nlohmann::ordered_json::array({told, agreed, untold});
  return nlohmann::ordered_json{
      {"schema", "takt.drives/1"}, {"config_sha256", config_sha256}, {"drives", nlohmann::ordered_json::array({drive})}}
      .dump();
}

// What the drives said of themselves goes with the run: newest cards, in a file, the manifest and the report.
TEST_F(RecorderTest, KeepsTheDrivesCards) {
  auto stream = attach();
  const auto recorder = start(path("run"));
  record(stream, *recorder, 100);
  recorder->drive_cards(drive_cards(demo_robot().sha256, "5011"));
  recorder->drive_cards(drive_cards(demo_robot().sha256, "5012"));
  recorder->drive_cards("not JSON");
  recorder->drive_cards(R"({"schema": 3})");
  recorder->drive_cards(drive_cards("another robot's", "1"));
  EXPECT_EQ(opened(path("run")).manifest.drives.at("drives")[0].at("facts")[0].at("value"), "5012")
      << "a run that goes on, or was cut off, has them too";
  finish(stream, *recorder);
  const RecordedRun run = opened(path("run"));
  EXPECT_EQ(run.folder.read_manifest()->drives.at("drives")[0].at("facts")[0].at("value"), "5012") << "quoted";
  const auto metrics = metrics_of(run);
  ASSERT_TRUE(metrics);
  const std::string report = evidence::report_text(*metrics, run);
  EXPECT_NE(report.find("drives        elbow (mit): DIFFERS: firmware 5012 (should be 5013), mode 1 (MIT); unknown: "
                        "home; watchdog waived: seen to stop\n"),
            std::string::npos)
      << report;
}

// Replay reads hashes as numbers.
TEST_F(RecorderTest, AManifestWhosePolicyHashesAreNoneIsRefused) {
  const auto refusal = [&](auto alter) -> std::string {
    auto json = to_json(robot_.manifest());
    alter(json);
    const auto manifest = manifest_of(json);
    return manifest ? "" : manifest.error();
  };
  EXPECT_EQ(refusal([](auto&) {}), "");
  for (const char* key : {"policy_hash", "fallback_policy_hash"})
    for (const char* hash : {"no hash", "11223344556677889", "-1"}) {
      const std::string said = refusal([&](auto& json) { json["executive"]["facts"][key] = hash; });
      EXPECT_NE(said.find(std::string(key) + " is no hash"), std::string::npos) << said;
    }
  EXPECT_NE(refusal([](auto& json) { json["executive"]["facts"]["policy_hash"] = 5; }), "");
  EXPECT_NE(refusal([](auto& json) { json["policy"] = {{"file", "policy.onnx"}, {"sha256", "zz"}}; }), "");
}

TEST_F(RecorderTest, ARunWithoutCardsSaysNothingOfDrives) {
  auto stream = attach();
  const auto recorder = start(path("run"));
  record(stream, *recorder, 100);
  finish(stream, *recorder);
  const RecordedRun run = opened(path("run"));
  EXPECT_TRUE(run.manifest.drives.is_null());
  EXPECT_FALSE(std::filesystem::exists(run.folder.drives()));
  EXPECT_EQ(evidence::report_text(*metrics_of(run), run).find("drives  "), std::string::npos);
}

// A monitor that slept for longer than the ring is long: what it missed is declared, the rest is right and replays.
TEST_F(RecorderTest, ASlowMonitorDeclaresWhatItMissed) {
  auto stream = attach();
  const auto recorder = start(path("run"));
  record(stream, *recorder, 1'000);
  robot_.run(10'000);
  record(stream, *recorder, 1'000);
  finish(stream, *recorder);
  const RecordedRun run = opened(path("run"));
  const auto ticks = ticks_in(run);
  EXPECT_GT(run.manifest.losses.at("tick overwritten"), 1'000U);
  EXPECT_EQ(run.manifest.losses.at("tick overwritten") + ticks.size(), 12'000U);
  const auto metrics = metrics_of(run);
  ASSERT_TRUE(metrics);
  EXPECT_EQ(metrics->missing_ticks, 12'000U - ticks.size());
  EXPECT_EQ(metrics->losses, run.manifest.losses) << "the losses stand in ticks.mcap as well";
  EXPECT_NE(evidence::report_text(*metrics, run).find("tick overwritten"), std::string::npos);
  const auto report = evidence::replay(run, 1);
  ASSERT_TRUE(report);
  EXPECT_TRUE(report->reproduces()) << evidence::replay_text(*report);
  EXPECT_GE(report->gaps, 1U);
  EXPECT_GT(report->not_judged, 0U);
}

// A monitor that comes late, or again, records what the rings still hold and says what they do not.
TEST_F(RecorderTest, ALateMonitorBeginsWithWhatTheRingsHold) {
  robot_.run(9'000);
  auto stream = attach();
  const auto recorder = start(path("run"));
  record(stream, *recorder, 500);
  finish(stream, *recorder);
  const RecordedRun run = opened(path("run"));
  EXPECT_EQ(run.manifest.losses.at("tick before_attach"), run.manifest.first_tick - 1);
  EXPECT_EQ(run.manifest.last_tick, 9'500U);
  const auto report = evidence::replay(run, 1);
  ASSERT_TRUE(report);
  EXPECT_TRUE(report->reproduces()) << evidence::replay_text(*report);
}

TEST_F(RecorderTest, TheSizeLimitStopsRecordingWithADeclaredLoss) {
  auto stream = attach();
  const auto recorder = start(path("run"), 300'000);
  expect_declared_stop(path("run"), *recorder, stream);
  EXPECT_NE(recorder->stop_reason().find("limit of 300000 bytes"), std::string::npos) << recorder->stop_reason();
}

// The kernel's own refusal: no file of this process may grow beyond the limit. Nothing may grow, not even the reserve's
// room helps: the manifest, which is small, still tells.
TEST_F(RecorderTest, AKernelLimitStopsRecordingWithADeclaredLoss) {
  auto stream = attach();
  const auto recorder = start(path("run"));
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, SIG_IGN);
  const rlimit tight{300'000, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &tight), 0);
  expect_declared_stop(path("run"), *recorder, stream);
  ::setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_NE(recorder->stop_reason().find("File too large"), std::string::npos) << recorder->stop_reason();
}

// A disk that is really full: the reserve makes room for the closing words.
// Threat: disk-full
TEST_F(RecorderTest, AFullDiskStopsRecordingWithADeclaredLoss) {
  const std::string disk = path("disk");
  std::filesystem::create_directory(disk);
  if (::mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=2m") != 0) GTEST_SKIP() << "SKIPPED: may not mount a tmpfs";
  {
    auto stream = attach();
    const auto recorder = start(disk + "/run");
    std::ofstream(disk + "/filler") << std::string(600'000, 'x');  // another process's file
    expect_declared_stop(disk + "/run", *recorder, stream);
    EXPECT_NE(recorder->stop_reason().find("No space left"), std::string::npos) << recorder->stop_reason();
    EXPECT_TRUE(evidence::replay(opened(disk + "/run"), 1)->file.finished) << "the reserve had room for the index";
  }
  EXPECT_EQ(::umount(disk.c_str()), 0);
}

class RefusingMedium : public RecorderTest, public testing::WithParamInterface<const char*> {};

TEST_P(RefusingMedium, StopsRecordingWithADeclaredLoss) {
  auto stream = attach();
  const auto recorder = start(path("run"));
  refused_file = GetParam();
  taken_before = 2;
  expect_declared_stop(path("run"), *recorder, stream);
  EXPECT_NE(recorder->stop_reason().find(std::string(GetParam()) + " does not reach its medium: Input/output error"),
            std::string::npos)
      << recorder->stop_reason();
}

INSTANTIATE_TEST_SUITE_P(OfEveryFile, RefusingMedium, testing::Values("ticks.mcap", "can.log.zst", "transitions.jsonl"),
                         [](const auto& row) { return std::string(row.param, std::strcspn(row.param, ".")); });

// Goal: a robot does not move on while its record goes where no reader finds it. Method: another program deletes,
// renames, replaces or cuts each file, and renames the folder, while the recorder writes; it stops and says so.
// Threat: run-taken
TEST_F(RecorderTest, AFileThatIsTakenAwayStopsRecording) {
  namespace fs = std::filesystem;
  const std::pair<const char*, std::function<void(const std::string&)>> deeds[] = {
      {"is gone", [](const std::string& file) { fs::remove(file); }},
      {"is gone", [](const std::string& file) { fs::rename(file, file + ".kept"); }},
      {"is gone", [](const std::string& file) { fs::rename(file, file + ".kept"), std::ofstream(file) << "other"; }},
      {"is gone",
       [](const std::string& file) {
         const std::string folder = fs::path(file).parent_path().string();
         fs::rename(folder, folder + "-moved");
       }},
      {"was cut", [](const std::string& file) { fs::resize_file(file, 3); }}};
  int run = 0;
  for (const char* const name : {"ticks.mcap", "can.log.zst", "transitions.jsonl"}) {
    for (const auto& [word, deed] : deeds) {
      auto stream = attach();
      const std::string folder = path("run" + std::to_string(++run));
      const auto recorder = start(folder);
      record(stream, *recorder, 1'000);
      if (std::string_view(word) == "was cut" && fs::file_size(folder + "/" + name) <= 3) continue;
      deed(folder + "/" + name);
      record(stream, *recorder, 1'500);
      EXPECT_NE(recorder->stop_reason().find(word), std::string::npos) << name << ": " << recorder->stop_reason();
      EXPECT_EQ(recorder->written_through(), 0U) << name;
    }
  }
}

// Every tick is on the medium, the words that close the file are not.
TEST_F(RecorderTest, ARunThatCannotBeClosedIsNotComplete) {
  auto stream = attach();
  const auto recorder = start(path("run"));
  record(stream, *recorder, 1'000);
  refused_file = "ticks.mcap";
  taken_before = 1;
  finish(stream, *recorder);
  EXPECT_NE(recorder->stop_reason(), "");
  const RecordedRun run = opened(path("run"));
  EXPECT_FALSE(run.manifest.complete);
  EXPECT_EQ(run.manifest.stopped_because, recorder->stop_reason());
  EXPECT_EQ(ticks_in(run).size(), 1'000U);
  EXPECT_EQ(run.manifest.ticks, 1'000U);
  EXPECT_EQ(run.manifest.unrecorded_ticks, 0U);
}

TEST_F(RecorderTest, AFolderThatReachesNoMediumIsRefused) {
  refused_file = "ticks.mcap";
  taken_before = 0;
  const auto folder = RunFolder::create(path("run"));
  ASSERT_TRUE(folder);
  const auto recorder = Recorder::start(*folder, robot_.manifest(), demo_robot(), 1U << 30U);
  ASSERT_FALSE(recorder);
  EXPECT_NE(recorder.error().find("ticks.mcap does not reach its medium"), std::string::npos) << recorder.error();
}

TEST_F(RecorderTest, AnExistingRunIsNeverWrittenInto) {
  const auto first = RunFolder::create(path("run"));
  const auto second = RunFolder::create(path("run"));
  const auto third = RunFolder::create(path("run"));
  ASSERT_TRUE(first && second && third);
  EXPECT_EQ(first->path(), path("run"));
  EXPECT_EQ(second->path(), path("run") + ".2");
  EXPECT_EQ(third->path(), path("run") + ".3");
}

// Power cut: the file ends somewhere. All but the last second of ticks come back, and they reproduce.
TEST_F(RecorderTest, ARunCutOffLosesAtMostItsLastSecond) {
  auto stream = attach();
  const auto recorder = start(path("run"));
  record(stream, *recorder, 3'350);
  // Not finished: what a killed monitor leaves. Then a torn write.
  std::ofstream(path("run") + "/ticks.mcap", std::ios::app | std::ios::binary) << "\x06torn chunk";
  const RecordedRun run = opened(path("run"));
  EXPECT_FALSE(run.manifest.complete);
  const auto ticks = ticks_in(run);
  EXPECT_GE(ticks.size(), 3'350U - 1'000U);
  const auto report = evidence::replay(run, 1);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->identical, ticks.size());
  EXPECT_FALSE(report->file.finished);
  const std::string said = fmt::format("what came after tick {} is not in this folder", ticks.back());
  EXPECT_NE(evidence::replay_text(*report).find(said), std::string::npos) << evidence::replay_text(*report);
  EXPECT_FALSE(report->is_whole());
}

}  // namespace
}  // namespace takt::monitor
