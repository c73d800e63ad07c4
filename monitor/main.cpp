// SPDX-License-Identifier: Apache-2.0
// takt-monitor: records what an executive does into run folders, and tells ROS 2, Prometheus and OpenTelemetry where
// the robot file says so. Tells the executive how far the run has reached its medium, and else only reads, unless its
// `dds` section allows requests; the executive's loop waits for nothing here. Or writes the summary of one closed run.
// Exit codes: 0 ended by a signal, 1 so too, but a recording had stopped before its run ended, or the summary could not
// be written, 64 usage, 65 configuration refused, 71 the run folder cannot be written.
#include <fmt/format.h>
#include <malloc.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <time.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/contract/version.hpp"
#include "executive/log/program_log.hpp"
#include "executive/program/program.hpp"
#include "executive/trace/trace.hpp"
#include "monitor/closing_reviews.hpp"
#include "monitor/executive_session.hpp"
#include "monitor/exports.hpp"
#include "monitor/image_watch.hpp"
#include "monitor/judge/run_metrics.hpp"
#include "monitor/policy_input_session.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/intervention_log.hpp"
#include "monitor/record/record_stream.hpp"
#include "monitor/record/run_parts.hpp"
#include "monitor/record/word_log.hpp"
#include "monitor/run_keeper.hpp"

namespace {

using namespace takt;
using namespace takt::monitor;

constexpr int kExitIncomplete = 1;
constexpr int kExitNoReview = 1;
constexpr Duration kDrainPeriod = milliseconds(20);
constexpr Duration kAttachPeriod = milliseconds(200);

struct Options : program::RobotOptions {
  std::string run_directory, review;
  std::uint64_t part_mib = kDefaultPartBytes >> 20U;
};

std::int64_t realtime_ns() {
  timespec time{};
  clock_gettime(CLOCK_REALTIME, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

std::string wanted_folder(const Options& options, const config::RobotConfig& robot, const std::string& run_id) {
  return options.run_directory.empty() ? robot.record.directory + "/" + run_id : options.run_directory;
}

// Looks ten times a second for what is new in a small file.
class DriveCardCopy {
 public:
  explicit DriveCardCopy(std::string path) : path_(std::move(path)) {}
  std::optional<std::string> look(MonoTime now) {
    if (looked_at_.is_set() && now - looked_at_ < milliseconds(100)) return std::nullopt;
    looked_at_ = now;
    auto text = read_file(path_);
    if (!text || *text == known_) return std::nullopt;
    return known_ = std::move(*text);
  }

 private:
  std::string path_, known_;
  MonoTime looked_at_;
};

int write_review(const std::string& folder) {
  const auto run = open_run(folder);
  const auto metrics = run ? write_metrics(*run) : std::unexpected(run.error());
  if (metrics) return 0;
  spdlog::warn("metrics.json is missing: {}", metrics.error());
  return kExitNoReview;
}

enum class Recorded : std::uint8_t { whole, in_part, not_at_all };

// One session of the executive, from attach to its end or ours. Not at all: the folder cannot be written.
Recorded record_session(const ExecutiveSession& session, const Options& options, const config::RobotConfig& robot,
                        const RunKeeper& keeper, trace::Introduction& introduction, Exports& exports,
                        ClosingReviews& reviews, InterventionLog& interventions, const std::atomic<bool>& stop) {
  RunManifest manifest = describe(session, robot, options.runtime_directory, monotonic_now(), realtime_ns());
  const auto folder = RunFolder::create(wanted_folder(options, robot, manifest.run_id));
  if (folder) manifest.run_id = std::filesystem::path(folder->path()).filename();  // one name for one run
  auto recorder =
      folder ? RunParts::start(*folder, manifest, robot, options.part_mib << 20U) : std::unexpected(folder.error());
  auto stream = RecordStream::attach(session.rings(), robot.joints.size(), config::largest_command_of(robot));
  if (!recorder || !stream) {
    spdlog::error("{}", recorder ? stream.error() : recorder.error());
    return Recorded::not_at_all;
  }
  PolicyInputSession inputs(options.runtime_directory, robot, Player::policy);
  PolicyInputSession fallback_inputs(options.runtime_directory, robot, Player::fallback);
  PolicyInputSession candidate_inputs(options.runtime_directory, robot, Player::candidate);
  spdlog::info("recording into {}", folder->path());
  exports.begin(manifest, folder->path(), monotonic_now());
  auto images = std::make_shared<ImageWatch>(options.runtime_directory, robot, *folder);
  WordLog words(*folder);
  auto warn_of_interventions = [&interventions, said = std::string()]() mutable {
    if (interventions.failure() != said && !interventions.failure().empty())
      spdlog::warn("an intervention is not in the log: {}", interventions.failure());
    said = interventions.failure();
  };
  interventions.note_start(manifest, robot, realtime_ns());
  warn_of_interventions();
  (*recorder)->on_seam([&](const RunFolder& next, const RunManifest& of_next) -> RunParts::LastWords {
    spdlog::info("recording goes on in {}", next.path());
    exports.go_on(of_next, next.path(), monotonic_now());
    words.go_on_in(next);
    auto before = std::exchange(images, std::make_shared<ImageWatch>(options.runtime_directory, robot, next));
    return [before = std::move(before)](const RecordSink& last) { before->finish(last); };
  });
  RecordSink sink = exports.also_to((*recorder)->sink());
  sink.policy_input = [&, record = sink.policy_input](const RecordedPolicyInput& input) {
    record(input);
    if ((*recorder)->stop_reason().empty() && !(*recorder)->stands_by()) images->shown(input.input);
  };
  sink.loss = [declare = sink.loss, said = false](const Loss& loss) mutable {
    declare(loss);
    if (loss.ring == kImageLoss && !std::exchange(said, true))
      spdlog::warn("images that policies are shown go without a file, some or all: {} (docs/run-folder.md)",
                   loss.reason);
  };
  auto tell_if_stopped = [&, said = false]() mutable {
    if ((*recorder)->stop_reason().empty()) return;
    exports.recording_stopped((*recorder)->manifest().unrecorded_ticks);
    if (!std::exchange(said, true))
      spdlog::error("recording stopped: {}; what the robot does from here on is not recorded",
                    (*recorder)->stop_reason());
  };
  auto tell_if_it_goes_on_here = [&, said = std::string()]() mutable {
    const std::string& why = (*recorder)->failure();
    if (why != said && !why.empty())
      spdlog::error("no next part of the record: {}; it goes on in {}", why, (*recorder)->folder().path());
    said = why;
  };
  auto review = [&](const std::string& closed) {
    if (const auto begun = reviews.begin(closed); !begun) spdlog::warn("{}", begun.error());
  };
  auto tell_progress = [&, told = std::uint64_t{0}]() mutable {
    const std::uint64_t through = (*recorder)->written_through();
    if (std::exchange(told, through) != through) session.tell_recorded(through);
  };
  auto note_words = [&, said = false]() mutable {
    while (const auto word = session.next_word()) {
      std::visit([&](const auto& one) { words.note(one); }, *word);
      if (const auto* const request = std::get_if<OperatorWord>(&*word)) {
        interventions.note(*request, robot.robot, request->heard_at.ns + manifest.clock.monotonic_to_unix_ns);
        warn_of_interventions();
      }
    }
    if (!words.failure().empty() && !std::exchange(said, true))
      spdlog::warn("what policies' hosts say and operators ask is not recorded, some or all: {}", words.failure());
  };
  DriveCardCopy cards(options.runtime_directory + "/drives.json");
  // Behind the ticks, so that what is read first is what fills fastest.
  auto drain_all = [&](bool is_last) {
    stream->drain(sink, is_last);
    for (PolicyInputSession* const session_of : {&inputs, &fallback_inputs, &candidate_inputs})
      session_of->drain(monotonic_now(), sink);
    images->hand_on(sink);
  };
  MonoTime next = monotonic_now();
  while (!stop && !session.is_over()) {
    introduction.when_traced(monotonic_now());
    trace::drain_begin((*recorder)->manifest().last_tick);
    drain_all(false);
    trace::drain_end((*recorder)->manifest().last_tick, (*recorder)->manifest().ticks);
    (*recorder)->flush_if_due(monotonic_now());
    if (const auto changed = cards.look(monotonic_now())) (*recorder)->drive_cards(*changed);
    note_words();
    tell_if_stopped();
    tell_if_it_goes_on_here();
    tell_progress();
    for (const std::string& closed : (*recorder)->take_closed()) review(closed);
    exports.room_left(keeper.hours_left());
    exports.drained(monotonic_now());
    reviews.look();
    next = std::max(next + kDrainPeriod, monotonic_now());
    sleep_until(next);
  }
  session.tell_recorded(0);  // before the last words: closing a run takes its time
  drain_all(true);
  note_words();
  images->finish(sink);
  const char* why = stop ? "monitor told to end" : "executive ended";
  if (const auto written = (*recorder)->finish(monotonic_now(), why); !written) spdlog::error("{}", written.error());
  tell_if_stopped();
  exports.end(monotonic_now(), session.is_over());
  for (const std::string& closed : (*recorder)->take_closed()) review(closed);
  review((*recorder)->folder().path());
  spdlog::info("run of {} ticks closed: {}", (*recorder)->manifest().ticks, why);
  return (*recorder)->stop_reason().empty() ? Recorded::whole : Recorded::in_part;
}

int monitor_robot(Options options) {
  const auto robot = config::load(options.robot);
  if (!robot) {
    fmt::print(stderr, "{}\n", robot.error());
    return config::kExitBadConfiguration;
  }
  if (robot->otlp && !robot->otlp->endpoint.empty() && !OtlpSender::is_built_in()) {
    fmt::print(stderr,
               "{}: otlp.endpoint: this takt-monitor was built without HTTP: build with TAKT_WITH_OTLP, or leave "
               "the key out; the run folder has the same files\n",
               robot->file);
    return config::kExitBadConfiguration;
  }
  options.runtime_directory = program::runtime_directory_of(options, *robot);
  const std::atomic<bool>& stop = program::stop_on_signals();
  std::uint64_t policy_hash = 0;
  if (robot->policy) policy_hash = config::policy_hash(robot->policy->file).value_or(0);
  trace::Introduction introduction("takt-monitor", robot->hash, policy_hash, robot->joints);
  Exports exports(*robot, options.runtime_directory);
  const RunKeeper keeper(*robot);
  ClosingReviews reviews;
  InterventionLog interventions(intervention_folder(robot->record.directory));
  std::string said;
  int exit_code = 0;
  while (!stop) {
    const auto session = ExecutiveSession::attach(Role::monitor, "takt-monitor", options.runtime_directory, *robot,
                                                  std::chrono::milliseconds(500));
    if (session) {
      said.clear();
      const Recorded recorded =
          record_session(*session, options, *robot, keeper, introduction, exports, reviews, interventions, stop);
      if (recorded == Recorded::not_at_all) return kExitSetUpRefused;
      if (recorded == Recorded::in_part) exit_code = kExitIncomplete;
    } else if (session.error() != said) {
      said = session.error();
      spdlog::info("waiting for the executive: {}", said);
    }
    reviews.look();
    if (!stop) sleep_until(monotonic_now() + kAttachPeriod);
  }
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  log::log_to_stderr("takt-monitor");
  Options options;
  CLI::App app("Records a running executive into run folders.", "takt-monitor");
  auto* const what = app.add_option_group("what to do");
  what->add_option("--robot", options.robot, "robot file: record its executive");
  what->add_option("--review", options.review, "run folder that was closed: write its metrics.json, and end");
  what->require_option(1);
  program::add_runtime_directory(app, options);
  app.add_option(
      "--run-dir", options.run_directory,
      "run folder; default <record.directory>/<UTC time>-<robot>-<id>; a second session, or part, gets .2 behind it");
  app.add_option("--max-file-mib", options.part_mib,
                 "the record goes on in a folder of its own when ticks.mcap or can.log.zst has this size")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 30U));
  app.footer(
      "Example: takt-monitor --robot config/arm6.yaml --runtime-dir /run/takt/arm6\n"
      "Exit codes: 0 ended by a signal, or reviewed, 1 a recording stopped before its run ended, or no review, 64 "
      "usage,\n"
      "65 configuration, 71 run folder cannot be written.");
  if (const auto ended = program::parse(app, argc, argv)) return *ended;
  if (!options.review.empty()) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);  // a monitor that crashed must not wait for its review to be started again
    setpriority(PRIO_PROCESS, 0, 19);  // a part is reviewed while the robot moves
    return write_review(options.review);
  }
  // What is written out twice a second goes back at once, and is no hole in what stays; so do the closing thread's own
  // words. Left to itself the allocator keeps tens of MiB after an hour.
  mallopt(M_MMAP_THRESHOLD, 256 << 10);
  mallopt(M_TRIM_THRESHOLD, 512 << 10);
  mallopt(M_ARENA_MAX, 1);
  signal(SIGXFSZ, SIG_IGN);  // a file at its size limit is an error of the write, not the end of the process
  return monitor_robot(std::move(options));
}
