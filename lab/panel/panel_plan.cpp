// SPDX-License-Identifier: Apache-2.0
#include "lab/panel/panel_plan.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <time.h>

#include <algorithm>
#include <utility>

#include "config/hash.hpp"
#include "config/load.hpp"
#include "config/model_text.hpp"
#include "executive/contract/version.hpp"
#include "lab/artifact/confusion.hpp"
#include "lab/judge/post_mortem.hpp"
#include "lab/panel/kept_inputs.hpp"
#include "monitor/judge/fault_classifier.hpp"
#include "policy_host/engines/load_policy.hpp"
#include "policy_host/policy_fit.hpp"

namespace takt::lab {
namespace {

// The parts of the canonical robot file that say what the simulated world is, whatever a method overrides elsewhere.
std::string plant_text(const config::RobotConfig& robot) {
  std::string text;
  bool inside = false;
  for (std::size_t at = 0; at < robot.resolved.size();) {
    const std::size_t end = std::min(robot.resolved.find('\n', at), robot.resolved.size() - 1);
    const std::string_view line = std::string_view(robot.resolved).substr(at, end + 1 - at);
    if (!line.starts_with(' '))
      inside = line.starts_with("simulation:") || line.starts_with("model:") || line.starts_with("joints:");
    if (inside) text += line;
    at = end + 1;
  }
  return text;
}

// Of the robot file's plant, an MJCF by its contents, and of what the process that plays the mechanics calls itself
// (`world`; empty: none does).
std::expected<std::string, std::string> plant_sha256_of(const config::RobotConfig& robot, const std::string& world) {
  std::string text = plant_text(robot);
  if (!world.empty()) text += "world: " + world + "\n";
  if (world.empty() && robot.simulation && robot.simulation->mujoco) {
    const auto model = config::model_bytes(robot.simulation->mujoco->model);
    if (!model) return std::unexpected(model.error());
    text += "mjcf: " + config::sha256_hex(*model) + "\n";
  }
  return config::sha256_hex(text);
}

std::expected<void, std::string> give_network(Contestant& made) {
  auto policy = policy_host::load_policy(made.robot);
  if (!policy) return std::unexpected(policy.error());
  if (const auto fits = policy_host::check_fit(made.robot, **policy); !fits) return std::unexpected(fits.error());
  made.policy = std::move(*policy);
  return {};
}

// Does it take the robot? It is started again where it rolls out.
std::expected<void, std::string> give_program(Contestant& made, const evidence::OutsideProcesses& outside) {
  made.program = std::make_unique<evidence::PolicyProcess>(outside.policy, outside.policy_may);
  auto begun = made.program->begin(made.robot, made.policy_hash);
  made.program->end();
  return begun;
}

// `world`: what the process that plays the mechanics calls itself; empty: none does.
std::expected<Contestant, std::string> make_contestant(const config::RobotConfig& base, const PanelMethod& method,
                                                       const std::string& world,
                                                       const evidence::OutsideProcesses& outside) {
  auto robot = config::with_overrides(base, method.overrides);
  if (!robot) return std::unexpected(robot.error());
  if (const auto fine = policy_host::check_policy_section(*robot); !fine) return std::unexpected(fine.error());
  Contestant made;
  made.robot = std::move(*robot);
  const config::Policy& section = *made.robot.policy;
  auto sha256 = config::policy_sha256(section.file);
  if (!sha256) return std::unexpected(sha256.error());
  made.policy_sha256 = std::move(*sha256);
  made.policy_hash = config::leading_64_bits(made.policy_sha256);
  if (const auto given = outside.policy.empty() ? give_network(made) : give_program(made, outside); !given)
    return std::unexpected(given.error());
  auto fallback = evidence::load_fallback_host(made.robot);
  if (!fallback) return std::unexpected(fallback.error());
  made.fallback = std::move(*fallback);
  auto plant = plant_sha256_of(base, world);
  if (!plant) return std::unexpected(plant.error());
  made.plant_sha256 = std::move(*plant);
  return made;
}

std::string joints_problem(const Panel& panel, const config::RobotConfig& robot) {
  const bool rotates =
      std::ranges::any_of(panel.perturbations, [](const auto& one) { return one.has("wrong_joint_order"); });
  if (!rotates || robot.joints.size() > 1) return {};
  return robot.file + ": one joint has no order to get wrong; take perturbation `wrong_joint_order` out of the panel";
}

// What the world calls itself; empty: there is none.
std::expected<std::string, std::string> ask(simulation::WorldProcess* world, const config::RobotConfig& robot,
                                            evidence::Task task) {
  if (world == nullptr && task == evidence::Task::world)
    return std::unexpected(robot.file + ": task world needs a process that plays it; name it by --world");
  if (world == nullptr) return std::string();
  if (!robot.simulation) return std::unexpected(robot.file + ": no `simulation`: a world needs its step");
  const auto facts = world->ask(robot);
  if (!facts) return std::unexpected(facts.error().sentence);
  return facts->name;
}

class HostMeter {
 public:
  void fill(Duration simulated, evidence::HostMeasured& host) const {
    host.wall_s = seconds_of(CLOCK_MONOTONIC) - wall_;
    host.cpu_s = seconds_of(CLOCK_PROCESS_CPUTIME_ID) - cpu_;
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    host.peak_rss_kib = static_cast<std::uint64_t>(usage.ru_maxrss);
    host.realtime_factor = host.wall_s > 0 ? simulated.seconds() / host.wall_s : 0;
  }

 private:
  static double seconds_of(clockid_t clock) {
    timespec now{};
    clock_gettime(clock, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  }
  double wall_ = seconds_of(CLOCK_MONOTONIC), cpu_ = seconds_of(CLOCK_PROCESS_CPUTIME_ID);
};

}  // namespace

std::vector<PlannedRollout> plan_of(const Panel& panel, const Shard& shard) {
  std::vector<PlannedRollout> plan;
  std::size_t index = 0;
  for (std::size_t task = 0; task < panel.tasks.size(); ++task)
    for (std::size_t perturbation = 0; perturbation < panel.perturbations.size(); ++perturbation)
      for (std::size_t method = 0; method < panel.methods.size(); ++method)
        for (std::uint64_t seed = 0; seed < panel.seed_count; ++seed)
          if (panel.perturbations[perturbation].troubles(panel.tasks[task].task) &&
              index++ % shard.count == shard.index - 1)
            plan.push_back({task, perturbation, method, panel.first_seed + seed});
  return plan;
}

std::expected<Contest, std::string> Contest::prepare(Panel panel, const evidence::OutsideProcesses& outside) {
  Contest contest(std::move(panel));
  contest.outside_ = outside;
  if (!outside.world.empty()) contest.world_ = std::make_unique<simulation::WorldProcess>(outside.world);
  std::string problems;
  const auto note = [&](const std::string& what) { problems += (problems.empty() ? "" : "\n") + what; };
  for (const PanelTask& task : contest.panel_.tasks) {
    auto robot = config::load(contest.panel_.robot.empty() ? task.robot : contest.panel_.robot);
    if (robot && !task.overrides.empty()) robot = config::with_overrides(*robot, task.overrides);
    if (!robot) {
      note(robot.error() + (contest.panel_.robot.empty() ? ", or name the robot file by --robot" : ""));
      continue;
    }
    if (const std::string problem = joints_problem(contest.panel_, *robot); !problem.empty()) note(problem);
    if (task.modes > 1 && !outside.policy.empty())
      note(contest.panel_.file +
           ": `modes` spoils what a network says, and --policy-host names a program; leave out one");
    const auto played = ask(contest.world_.get(), *robot, task.task);
    if (!played) {
      note(played.error());
      continue;
    }
    for (const PanelMethod& method : contest.panel_.methods) {
      auto made = make_contestant(*robot, method, *played, outside);
      if (made)
        contest.contestants_.push_back(std::move(*made));
      else
        note(fmt::format("{}: method {}: {}", contest.panel_.file, method.name, made.error()));
    }
  }
  if (!problems.empty()) return std::unexpected(problems);
  return contest;
}

void Contest::clean_up() {
  if (world_) world_->give_up();
  for (const Contestant& contestant : contestants_)
    if (contestant.program) contestant.program->end();
}

evidence::RolloutRow Contest::identity(const PlannedRollout& planned) const {
  const Contestant& who = contestant(planned);
  const PanelPerturbation& perturbation = panel_.perturbations[planned.perturbation];
  evidence::RolloutRow row;
  row.panel = panel_.name;
  row.panel_sha256 = panel_.sha256;
  row.task = evidence::kTaskNames[static_cast<std::size_t>(panel_.tasks[planned.task].task)];
  row.method = panel_.methods[planned.method].name;
  row.seed = planned.seed;
  row.perturbation = perturbation.name();
  row.dose = perturbation.dose;
  row.config_sha256 = who.robot.sha256;
  row.policy_sha256 = who.policy_sha256;
  row.plant_sha256 = who.plant_sha256;
  row.script_version = release();
  row.script_source_sha256 = source_sha256();
  return row;
}

ArtifactManifest Contest::manifest(std::size_t planned) const {
  ArtifactManifest made;
  made.panel = panel_.name;
  made.panel_sha256 = panel_.sha256;
  made.script_version = release();
  made.script_source_sha256 = source_sha256();
  made.claims = panel_.claims;
  made.outside = {outside_program(outside_.world), outside_program(outside_.policy)};
  made.planned_rollouts = planned;
  made.seed_plan = seed_plan_of(panel_.first_seed, panel_.seed_count);
  for (std::size_t task = 0; task < panel_.tasks.size(); ++task) {
    for (std::size_t method = 0; method < panel_.methods.size(); ++method) {
      const Contestant& who = contestant({.task = task, .method = method});
      const config::Freshness& freshness = who.robot.freshness;
      const std::string name(evidence::kTaskNames[static_cast<std::size_t>(panel_.tasks[task].task)]);
      made.plants[name] = who.plant_sha256;
      MethodFacts& facts = made.methods[panel_.methods[method].name];
      facts.description = panel_.methods[method].description;
      facts.tasks[name] = {
          who.robot.sha256, who.policy_sha256,
          evidence::own_max_age(panel_.methods[method].method).value_or(freshness.max_age).milliseconds(),
          freshness.epsilon, freshness.confidence};
    }
  }
  return made;
}

evidence::RolloutSetup Contest::setup_of(const PlannedRollout& planned) const {
  const Contestant& who = contestant(planned);
  const PanelTask& task = panel_.tasks[planned.task];
  evidence::PolicyTiming timing = panel_.timing;
  timing.modes = task.modes;
  timing.mode_spread = task.mode_spread;
  return {.robot = who.robot,
          .policy = who.program ? evidence::Answering(*who.program) : evidence::Answering(*who.policy),
          .policy_hash = who.policy_hash,
          .fallback = who.fallback.get(),
          .task = task.task,
          .timing = timing,
          .method = panel_.methods[planned.method].method,
          .repeat_last = panel_.methods[planned.method].repeat_last,
          .perturbation = panel_.perturbations[planned.perturbation].resolved(),
          .seed = planned.seed,
          .duration = panel_.duration,
          .scored = task.scored,
          .bound_m = task.bound_m,
          .rearm_after = panel_.rearm_after,
          .base_velocity = task.base_velocity,
          .world = world_.get()};
}

RolloutWatch::RolloutWatch(const config::RobotConfig& robot)
    : classifier_(monitor::fault_rules_of(robot)), monitors_(robot), incidents_(robot) {}

void RolloutWatch::shown(const evidence::ShownSample& shown) {
  const SensorSample& sample = shown.sample;
  if (shown.pixels.empty())
    classifier_.sample(shown.sensor, sample.sequence, sample.sensed_at, {sample.values, sample.value_count});
  else
    classifier_.image(shown.sensor, sample.sequence, sample.sensed_at,
                      {reinterpret_cast<const char*>(shown.pixels.data()), shown.pixels.size()});
}

std::expected<RanRollout, std::string> Contest::run(const PlannedRollout& planned) {
  const HostMeter meter;
  evidence::RolloutRow row = identity(planned);
  RolloutWatch watch(contestant(planned).robot);
  evidence::RolloutSetup setup = setup_of(planned);
  setup.on_command = [&](const CommandChunk& chunk) { watch.command(chunk); };
  setup.on_tick = [&](const TickRecord& record) { watch.tick(record); };
  setup.on_shown = [&](const evidence::ShownSample& shown) { watch.shown(shown); };
  std::string end;
  setup.on_world_end = [&](const simulation::WorldEnd& ended) { end = ended.sentence; };
  setup.on_silence = [&](const std::string& why) { end = why; };
  if (const auto done = evidence::run_rollout(setup, row); !done) return std::unexpected(done.error());
  RanRollout ran = conclude(std::move(row), watch, end);
  meter.fill(panel_.duration, ran.row.host);
  return ran;
}

RanRollout Contest::conclude(evidence::RolloutRow row, RolloutWatch& watch, const std::string& end) const {
  const monitor::FaultSummary faults = watch.classifier_.finish();
  row.leading_fault = leading_fault(faults);
  row.fault_verdicts = faults.total();
  for (std::size_t fault = 0; fault < monitor::kFaultCount; ++fault)
    row.fault_shares[fault] = faults.share(static_cast<monitor::Fault>(fault));
  row.chunk_levels = watch.monitors_.levels();
  row.catch_votes = static_cast<std::uint64_t>(watch.monitors_.rule().votes);
  row.catch_of = static_cast<std::uint64_t>(watch.monitors_.rule().of);
  row.catches = watch.monitors_.catch_count();
  RanRollout ran{.row = std::move(row), .post_mortem = {}};
  if (ran.row.success) return ran;
  const auto option = [](const char* name, const std::string& value) {
    return value.empty() ? "" : fmt::format(" {} '{}'", name, value);
  };
  std::string grants;
  for (const std::string& word : policy_host::grant_options(outside_.policy_may)) grants += " '" + word + "'";
  PostMortemDraft draft{
      .row = ran.row,
      .show_again =
          fmt::format("takt panel run {}{}{}{}{} --only {} --out again  # panel: SHA-256 {}", panel_.file,
                      panel_.robot.empty() ? "" : " --robot " + panel_.robot, option("--world", outside_.world),
                      option("--policy-host", outside_.policy), grants, evidence::rollout_id(ran.row), panel_.sha256),
      .ticks = &watch.failure_,
      .verdicts = {},
      .incidents = monitor::by_gravity(std::move(watch.told_))};
  if (!end.empty()) draft.verdicts.push_back(end);
  for (const monitor::FaultVerdict& verdict : faults.verdicts) draft.verdicts.push_back(verdict.sentence);
  ran.post_mortem = post_mortem_text(draft);
  return ran;
}

}  // namespace takt::lab
