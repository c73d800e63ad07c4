// SPDX-License-Identifier: Apache-2.0
// make_recorded_demo DIR: a recorded run of the virtual robot, for tests in other languages. Beside it DIR/truth.jsonl
// as takt-plant would write it: where the rigid-body library sees the tool at the recorded angles, and a target. And
// two more pages: thin.html of the same run with little room, gap.html of a copy without ticks 2200 to 2699; and
// DIR/viewed, a run with cameras' pictures in its ticks.mcap.
// make_recorded_demo DIR SECONDS: only a run, of that length, with an image and with events beside it.
#include <charconv>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <vector>

#include "config/load.hpp"
#include "evidence/review/report/report_html.hpp"
#include "monitor/judge/run_metrics.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/image_file.hpp"
#include "monitor/record/image_store.hpp"
#include "monitor/record/png_image.hpp"
#include "monitor/record/recorder.hpp"
#include "simulation/arm_dynamics.hpp"
#include "simulation/camera.hpp"
#include "simulation/truth_log.hpp"
#include "tests/monitor/record/recorded_demo.hpp"

namespace takt::monitor {
namespace {

void write_truth(const RecordedRun& run, const std::string& path) {
  auto arm = simulation::ArmDynamics::make(run.robot);
  auto truth = simulation::TruthLog::create(path);
  if (!arm || !truth) throw std::runtime_error(arm ? truth.error() : arm.error());
  const auto joints = static_cast<Eigen::Index>(run.robot.joints.size());
  simulation::ArmState state{Eigen::VectorXd::Zero(joints), Eigen::VectorXd::Zero(joints)};
  const auto write = [&](const RecordedTick& tick) {
    if (tick.record.header.tick % 10 != 0) return;
    for (Eigen::Index joint = 0; joint < joints; ++joint) state.q[joint] = tick.record.joints[joint].feedback.q;
    const MonoTime now = tick.record.header.now;
    truth->write({now, state, (*arm)->tool_position(state.q), simulation::target_at(*run.robot.simulation, {now.ns})});
  };
  const auto scanned = scan_run(run, {.tick = write, .command = {}, .keyframe = {}, .loss = {}});
  if (!scanned) throw std::runtime_error(scanned.error());
}

void write_page(const RecordedRun& run, const RunMetrics& metrics, const std::string& path, std::size_t whole_bytes) {
  const auto faults = classify_run(run);
  const auto series =
      faults ? evidence::series_of(run, metrics, *faults, "", whole_bytes) : std::unexpected(faults.error());
  if (!series) throw std::runtime_error(series.error());
  const auto written = replace_file(path, evidence::report_html({run, metrics, *faults, *series, std::nullopt}));
  if (!written) throw std::runtime_error(written.error());
}

void write_page_with_gap(const RecordedRun& run, const std::string& path) {
  const RecordedRun torn = altered_copy(
      run, run.folder.path() + "/torn", [](TickRecord&) {}, [](RecordedCommand&) {},
      [](std::uint64_t tick) { return tick < 2'200 || tick >= 2'700; });
  const auto metrics = metrics_of(torn);
  if (!metrics) throw std::runtime_error(metrics.error());
  write_page(torn, *metrics, path, evidence::kWholeBytes);
}

// The first sensor of the robot's file as a camera, 30 Hz, that ends at 2.64 s. Image k was sensed 33 k ms after the
// first tick and published 15 ms later; it is red by k, green by 255 - k, and its first pixel blue. Number 39 was lost
// since, number 21 went without a file.
void write_page_with_images(const RecordedRun& run, const MonoTime start, const std::string& path) {
  constexpr config::ImageShape kShape{24, 32, 3};
  constexpr std::uint64_t kImages = 80, kLost = 39, kWithoutFile = 21;
  const std::string directory = run.folder.path() + "/seen";
  const auto beside = RunFolder::create(directory + ".images");
  if (!beside) throw std::runtime_error(beside.error());
  ImageStore store(*beside, {.budget_mib = 100, .rate_mib_per_s = 1000});
  std::vector<ShownImage> images;
  for (std::uint64_t k = 0; k < kImages; ++k) {
    std::vector<std::byte> pixels;
    for (std::size_t at = 0; at < kShape.bytes(); at += kShape.channels)
      for (const std::uint64_t value : {k, 255 - k, at == 0 ? std::uint64_t{255} : std::uint64_t{0}})
        pixels.push_back(static_cast<std::byte>(value));
    const std::string file = image_file(kShape, pixels);
    const MonoTime sensed_at = start + milliseconds(33 * static_cast<std::int64_t>(k));
    ShownImage& image = images.emplace_back(ShownImage{.sequence = k,
                                                       .sensed_at = sensed_at,
                                                       .published_at = sensed_at + milliseconds(15),
                                                       .sensor = 0,
                                                       .shape = kShape,
                                                       .file = ImageFile::over_rate,
                                                       .sha256 = config::sha256_hex(file)});
    if (k != kWithoutFile) image.file = store.keep(image, file, sensed_at);
    if (k == kLost) std::filesystem::remove(directory + ".images/images/" + image_file_name(kShape, image.sha256));
  }
  const RecordedRun seen = altered_copy(
      run, directory, [](TickRecord&) {}, [](RecordedCommand&) {}, [](std::uint64_t) { return true; },
      Checksums::as_recorded, images);
  std::filesystem::rename(directory + ".images/images", seen.folder.images());
  const auto metrics = metrics_of(seen);
  if (!metrics) throw std::runtime_error(metrics.error());
  write_page(seen, *metrics, path, evidence::kWholeBytes);
}

// DIR/viewed: what a recorder is given of two cameras behind a sensor without images. Picture k of camera `left` was
// sensed k s after the beginning; it is red by its column, green by its row, and blue by k. Pictures whose stamps
// cannot be are none.
void record_pictures(const std::string& directory) {
  constexpr config::ImageShape kShape{24, 32, 3};
  config::RobotConfig robot = demo_robot();
  for (const char* name : {"right", "left"})
    robot.sensors.push_back({.name = name, .timeout = milliseconds(500), .image = kShape});
  const auto folder = RunFolder::create(directory);
  if (!folder) throw std::runtime_error(folder.error());
  const RunManifest manifest = VirtualRobot().manifest();
  const auto recorder = Recorder::start(*folder, manifest, robot);
  if (!recorder) throw std::runtime_error(recorder.error());
  const auto camera = static_cast<std::uint32_t>(robot.sensors.size() - 1);
  for (const MonoTime nonsensical : {MonoTime{INT64_MAX}, MonoTime{INT64_MIN}, MonoTime{}})
    (*recorder)->sink().picture({.sensed_at = nonsensical, .sensor = camera, .png = "none"});
  for (std::uint8_t k = 0; k < 3; ++k) {
    std::vector<std::byte> pixels;
    for (std::uint32_t row = 0; row < kShape.height; ++row)
      for (std::uint32_t column = 0; column < kShape.width; ++column)
        for (const std::uint32_t value : {column, row, std::uint32_t{k}})
          pixels.push_back(static_cast<std::byte>(value));
    (*recorder)->sink().picture(
        {.sensed_at = manifest.started_at + seconds(k), .sensor = camera, .png = png_image(kShape, pixels)});
  }
  const auto finished = (*recorder)->finish(manifest.started_at + seconds(3), "");
  if (!finished) throw std::runtime_error(finished.error());
}

constexpr std::uint64_t kTicksPerSecond = 1'000;

// The policy stalls once in four seconds, so that every ten of them have transitions.
void record_long(const std::string& directory, std::uint64_t seconds) {
  VirtualRobot robot;
  record(robot, directory, seconds * kTicksPerSecond, [&](std::uint64_t tick) {
    robot.policy_is_frozen = tick % (4 * kTicksPerSecond) >= 3 * kTicksPerSecond;
    if (tick != 0) return;
    const RunFolder folder(directory);
    std::filesystem::create_directories(folder.images());
    const auto image = replace_file(folder.images() + "/demo.pgm", "P5 2 2 255\n" + std::string("\x10\x20\x30\x40"));
    const auto events = replace_file(folder.path() + "/events.jsonl", "{\"event\":\"run\",\"monotonic_ns\":1}\n");
    if (!image || !events) throw std::runtime_error(image ? events.error() : image.error());
  });
}

}  // namespace
}  // namespace takt::monitor

int main(int argc, char** argv) {
  using namespace takt::monitor;
  std::uint64_t seconds = 0;
  const bool has_length = argc == 3 && std::from_chars(argv[2], argv[2] + std::strlen(argv[2]), seconds).ptr != argv[2];
  if (argc != 2 && !has_length) return 64;
  try {
    if (has_length) {
      record_long(argv[1], seconds);
      return 0;
    }
    const RecordedRun run = record_demo(argv[1]);
    write_truth(run, run.folder.path() + "/truth.jsonl");
    const auto metrics = write_metrics(run);
    if (!metrics) throw std::runtime_error(metrics.error());
    write_page(run, *metrics, run.folder.path() + "/thin.html", 60'000);
    write_page_with_gap(run, run.folder.path() + "/gap.html");
    write_page_with_images(run, metrics->start, run.folder.path() + "/seen.html");
    record_pictures(run.folder.path() + "/viewed");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_recorded_demo: %s\n", error.what());
    return 1;
  }
  return 0;
}
