// SPDX-License-Identifier: Apache-2.0
#include "lab/study/age_tolerance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "config/hash.hpp"
#include "config/load.hpp"
#include "lab/panel/panel_plan.hpp"
#include "lab/panel/worker_pool.hpp"
#include "monitor/judge/freshness_statistics.hpp"

namespace takt::study {
namespace {

constexpr double kDelayGrid_ms = 10, kMostDelay_ms = 640;
constexpr double kStallGrid_ms = 25, kMostStall_ms = 800;
constexpr double kSilenceGrid_ms = 50, kMostSilence_ms = 1600;
constexpr std::uint64_t kFailuresShown = 5;  // beyond these, a refused dose is not looked at any longer
constexpr double kAgeStep_ms = 5;
constexpr double kLongestTarget_ms = 10'000;

double lower_bound(std::uint64_t successes, std::uint64_t rollouts) {
  return 1 - monitor::clopper_pearson_upper(rollouts - successes, rollouts, kConfidence);
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

// The policy's word counts however old it is, up to `max_age`; nothing degrades or stops the robot. The one target of a
// policy that gives one at a time stays playable for as long.
std::vector<config::Override> without_consequences(const config::RobotConfig& robot, double max_age_ms) {
  std::vector<config::Override> said{{"freshness.max_age", fmt::format("{:.0f} ms", max_age_ms)},
                                     {"freshness.epsilon", "0.999999"},
                                     {"freshness.recover_after", fmt::format("{} us", robot.control.period.ns / 1000)},
                                     {"freshness.flap_memory", "0 ms"},
                                     {"freshness.stop_after", "600 s"},
                                     {"freshness.bad_command_limit", "1000000"}};
  if (robot.policy && robot.policy->steps == 1)
    said.push_back({"policy.step_period", fmt::format("{:.0f} ms", kLongestTarget_ms)});
  return said;
}

// A panel that exists in memory only: one task, one method, one kind of perturbation at every dose of a grid.
lab::Panel panel_of(const ToleranceSetup& setup, const config::RobotConfig& robot, std::string_view kind,
                    double grid_ms, double most_ms, double max_age_ms, Duration from = {}) {
  lab::Panel made;
  made.file = setup.robot_file;
  made.name = "margin";
  made.text = fmt::format("takt margin: {} of {}", kind, setup.robot_file);
  made.sha256 = config::sha256_hex(made.text);
  made.duration = setup.duration;
  made.seed_count = setup.seeds;
  made.tasks.push_back({.task = setup.task,
                        .robot = setup.robot_file,
                        .scored = setup.scored,
                        .bound_m = setup.bound_m,
                        .base_velocity = setup.base_velocity});
  made.methods.push_back({"margin", "no consequences", false, without_consequences(robot, max_age_ms)});
  for (int i = 0; i * grid_ms <= most_ms; ++i)
    made.perturbations.push_back({std::string(kind), i * grid_ms, from, setup.duration - from});
  return made;
}

constexpr std::size_t kFirstDose = 4;  // of the doubling

// The most doses that halving what lies between may look at; without any that is good, that of 0 besides.
std::size_t most_halvings(std::size_t good, std::size_t bad) {
  return static_cast<std::size_t>(std::bit_width(bad - good - 1)) + (good == 0 ? 1 : 0);
}

// The most doses that follow the look at `bad`, which doubling has reached.
std::size_t most_after(std::size_t good, std::size_t bad, std::size_t last) {
  const std::size_t refused = most_halvings(good, bad);
  return bad == last ? refused : std::max(refused, 1 + most_after(bad, std::min(2 * bad, last), last));
}

std::size_t most_doses(double grid_ms, double most_ms) {
  return 1 + most_after(0, kFirstDose, static_cast<std::size_t>(most_ms / grid_ms));
}

// What the whole has run, and the most doses that searches still to come may look at.
struct Work {
  std::size_t rollouts = 0, later_doses = 0, later_rollouts = 0;
};

// The doses of one panel, looked at one by one.
class Doses {
 public:
  Doses(const ToleranceSetup& setup, lab::Contest contest, Work& work)
      : setup_(setup), contest_(std::move(contest)), work_(work) {}

  // `doses_after`: the most that this search looks at after this one; only progress depends on it.
  std::expected<TolerancePoint, std::string> look_at(std::size_t index, std::size_t doses_after = 0) {
    if (const auto known = seen_.find(index); known != seen_.end()) return known->second;
    auto rows = run(index, doses_after + work_.later_doses);
    if (!rows) return std::unexpected(rows.error());
    return seen_.emplace(index, judge(index, *rows)).first->second;
  }
  // The largest tolerated dose: doubling until one is refused, then halving what lies between. The error is look_at's.
  std::expected<std::size_t, std::string> largest_tolerated() {
    const std::size_t last = contest_.panel().perturbations.size() - 1;
    std::size_t good = 0, bad = kFirstDose;
    for (;; bad = std::min(2 * bad, last)) {
      const auto point = look_at(bad, most_after(good, bad, last));
      if (!point) return std::unexpected(point.error());
      if (!point->tolerated) break;
      good = bad;
      if (bad == last) return last;
    }
    while (bad - good > 1) {
      const std::size_t middle = (good + bad) / 2;
      const auto point = look_at(middle, std::max(most_halvings(good, middle), most_halvings(middle, bad)));
      if (!point) return std::unexpected(point.error());
      (point->tolerated ? good : bad) = middle;
    }
    return good;
  }
  [[nodiscard]] std::size_t last() const { return contest_.panel().perturbations.size() - 1; }
  [[nodiscard]] std::vector<TolerancePoint> points() const {
    std::vector<TolerancePoint> all;
    for (const auto& [index, point] : seen_) all.push_back(point);
    return all;
  }

 private:
  // In order of seed, cut off at the failure that settles it, so that workers do not change the result.
  std::expected<std::vector<evidence::RolloutRow>, std::string> run(std::size_t index, std::size_t doses_after) {
    std::vector<evidence::RolloutRow> rows;
    std::uint64_t failures = 0;
    for (std::uint64_t first = 1; first <= setup_.seeds && failures < kFailuresShown; first += kBatch) {
      std::vector<lab::PlannedRollout> batch;
      for (std::uint64_t seed = first; seed < first + kBatch && seed <= setup_.seeds; ++seed)
        batch.push_back({.task = 0, .perturbation = index, .method = 0, .seed = seed});
      const auto done = lab::run_in_workers(contest_, batch, setup_.workers, [&](const lab::RanRollout& ran) {
        rows.push_back(ran.row);
        failures += ran.row.success ? 0U : 1U;
        ++work_.rollouts;
        tell(index, setup_.seeds - rows.size() + doses_after * setup_.seeds + work_.later_rollouts);
        return std::expected<void, std::string>{};
      });
      if (!done) return std::unexpected(done.error());
    }
    return rows;
  }
  void tell(std::size_t index, std::size_t most_left) const {
    if (!setup_.on_progress) return;
    const lab::PanelPerturbation& looked_at = contest_.panel().perturbations[index];
    setup_.on_progress(
        {work_.rollouts, work_.rollouts + most_left, fmt::format("{} {:g} ms", looked_at.kind, looked_at.dose)});
  }
  [[nodiscard]] TolerancePoint judge(std::size_t index, const std::vector<evidence::RolloutRow>& rows) const {
    TolerancePoint point;
    point.dose_ms = contest_.panel().perturbations[index].dose;
    std::vector<double> p50, p99;
    for (const evidence::RolloutRow& row : rows) {
      ++point.rollouts;
      point.successes += row.success ? 1U : 0U;
      p50.push_back(row.age_per_tick.total.p50_ms.value_or(0));
      p99.push_back(row.age_per_tick.total.p99_ms.value_or(0));
      point.miss_share += row.misses_per_tick.rate / static_cast<double>(rows.size());
    }
    point.age_p50_ms = median(std::move(p50));
    point.age_p99_ms = median(std::move(p99));
    point.success_lower = lower_bound(point.successes, point.rollouts);
    point.success_upper = monitor::clopper_pearson_upper(point.successes, point.rollouts, kConfidence);
    point.tolerated = point.rollouts == setup_.seeds && point.success_lower >= setup_.success;
    return point;
  }

  static constexpr std::uint64_t kBatch = 10;
  const ToleranceSetup& setup_;
  lab::Contest contest_;
  Work& work_;
  std::map<std::size_t, TolerancePoint> seen_;
};

std::expected<void, std::string> find_age(const ToleranceSetup& setup, const config::RobotConfig& robot, Work& work,
                                          AgeTolerance& found) {
  work.later_doses = most_doses(kStallGrid_ms, kMostStall_ms) + most_doses(kSilenceGrid_ms, kMostSilence_ms);
  auto contest = lab::Contest::prepare(panel_of(setup, robot, "publish_delay", kDelayGrid_ms, kMostDelay_ms, 40'000),
                                       setup.outside);
  if (!contest) return std::unexpected(contest.error());
  Doses doses(setup, std::move(*contest), work);
  const auto nominal = doses.look_at(0, most_doses(kDelayGrid_ms, kMostDelay_ms));
  if (!nominal) return std::unexpected(nominal.error());
  if (!nominal->tolerated)
    return std::unexpected(
        fmt::format("{}: the task fails without any added delay, in {} of {} rollouts; there is no age to tolerate",
                    setup.robot_file, nominal->rollouts - nominal->successes, nominal->rollouts));
  const auto largest = doses.largest_tolerated();
  if (!largest) return std::unexpected(largest.error());
  found.nominal_p99_ms = nominal->age_p99_ms;
  found.tolerated_age_ms = doses.look_at(*largest)->age_p50_ms;
  found.age_is_open = *largest == doses.last();
  found.max_age_ms = kAgeStep_ms * std::floor(setup.safety * found.tolerated_age_ms / kAgeStep_ms);
  found.ages = doses.points();
  return {};
}

double two_digits_below(double value) {
  const double digit = std::pow(10.0, std::floor(std::log10(value)) - 1);
  return digit * std::floor(value / digit + 1e-9);
}

std::expected<void, std::string> find_share(const ToleranceSetup& setup, const config::RobotConfig& robot, Work& work,
                                            AgeTolerance& found) {
  work.later_doses = most_doses(kSilenceGrid_ms, kMostSilence_ms);
  auto contest = lab::Contest::prepare(
      panel_of(setup, robot, "inference_stall", kStallGrid_ms, kMostStall_ms, found.max_age_ms), setup.outside);
  if (!contest) return std::unexpected(contest.error());
  Doses doses(setup, std::move(*contest), work);
  const auto largest = doses.largest_tolerated();
  if (!largest) return std::unexpected(largest.error());
  found.misses = doses.points();
  found.share_is_open = *largest == doses.last();
  const auto best = doses.look_at(*largest);
  if (!best) return std::unexpected(best.error());
  if (!best->tolerated || best->miss_share <= 0) return {};
  found.tolerated_share = best->miss_share;
  found.epsilon = two_digits_below(setup.safety * best->miss_share);
  return {};
}

// Halfway through the rollout the task is under way, and what follows is long enough to be judged.
std::expected<void, std::string> find_silence(const ToleranceSetup& setup, const config::RobotConfig& robot, Work& work,
                                              AgeTolerance& found) {
  work.later_doses = 0;
  auto contest = lab::Contest::prepare(panel_of(setup, robot, "policy_freeze", kSilenceGrid_ms, kMostSilence_ms,
                                                found.max_age_ms, Duration{setup.duration.ns / 2}),
                                       setup.outside);
  if (!contest) return std::unexpected(contest.error());
  Doses doses(setup, std::move(*contest), work);
  const auto largest = doses.largest_tolerated();
  if (!largest) return std::unexpected(largest.error());
  found.silences = doses.points();
  found.silence_is_open = *largest == doses.last();
  if (*largest == 0) return {};
  found.tolerated_silence_ms = doses.look_at(*largest)->dose_ms;
  const double proposed = kAgeStep_ms * std::floor(setup.safety * *found.tolerated_silence_ms / kAgeStep_ms);
  if (proposed > found.max_age_ms) found.stop_after_ms = proposed;
  return {};
}

constexpr std::array kWaits{milliseconds(5), milliseconds(50), milliseconds(250)};
constexpr std::array kMemories{Duration{}, seconds(10)};
constexpr std::uint64_t kMostRecoverySeeds = 20;
constexpr std::size_t kRecoveryTroubles = 2;

std::uint64_t recovery_seeds(const ToleranceSetup& setup) {
  return std::min(setup.seeds, kMostRecoverySeeds);
}
std::size_t recovery_rollouts(const ToleranceSetup& setup) {
  return kWaits.size() * kMemories.size() * kRecoveryTroubles * recovery_seeds(setup);
}

// The contract as it is proposed; what is not proposed is the robot file's.
std::vector<config::Override> as_proposed(const AgeTolerance& found, Duration wait, Duration memory) {
  std::vector<config::Override> said{{"freshness.max_age", fmt::format("{:.0f} ms", found.max_age_ms)},
                                     {"freshness.recover_after", fmt::format("{} us", wait.ns / 1000)},
                                     {"freshness.flap_memory", fmt::format("{} us", memory.ns / 1000)}};
  if (found.epsilon) said.push_back({"freshness.epsilon", fmt::format("{:g}", *found.epsilon)});
  if (found.stop_after_ms) said.push_back({"freshness.stop_after", fmt::format("{:.0f} ms", *found.stop_after_ms)});
  return said;
}

lab::Panel recovery_panel(const ToleranceSetup& setup, const config::RobotConfig& robot, const AgeTolerance& found,
                          std::vector<RecoveryPoint>& points) {
  lab::Panel made = panel_of(setup, robot, "none", 1, 0, found.max_age_ms);
  made.seed_count = recovery_seeds(setup);
  made.methods.clear();
  made.perturbations.clear();
  for (const Duration wait : kWaits)
    for (const Duration memory : kMemories) {
      made.methods.push_back(
          {fmt::format("recovery{}", points.size()), "as proposed", false, as_proposed(found, wait, memory), {}});
      points.push_back({.recover_after = wait, .flap_memory = memory});
    }
  const double delay_ms = std::max(found.max_age_ms - found.ages.front().age_p50_ms, 0.0);
  made.perturbations.push_back({"inference_stall", found.max_age_ms + 100, {}, setup.duration});
  made.perturbations.push_back({"publish_delay", delay_ms, {}, setup.duration});
  return made;
}

// Most often, then the fewest ticks in violation, then the fewest entries; of equals the longest wait, which is
// calmest.
const RecoveryPoint& best_of(const std::vector<RecoveryPoint>& points) {
  constexpr double kEqualTicks = 1, kEqualShare = 1.1;
  const auto most = std::ranges::max(points, {}, &RecoveryPoint::successes).successes;
  double fewest = std::numeric_limits<double>::infinity();
  for (const RecoveryPoint& point : points)
    if (point.successes == most) fewest = std::min(fewest, point.violated_ticks);
  const RecoveryPoint* best = nullptr;
  for (const RecoveryPoint& point : points) {
    if (point.successes != most || point.violated_ticks > kEqualShare * fewest + kEqualTicks) continue;
    if (best == nullptr || point.entries <= best->entries) best = &point;
  }
  return *best;
}

std::expected<void, std::string> find_recovery(const ToleranceSetup& setup, const config::RobotConfig& robot,
                                               Work& work, AgeTolerance& found) {
  std::vector<RecoveryPoint> points;
  auto contest = lab::Contest::prepare(recovery_panel(setup, robot, found, points), setup.outside);
  if (!contest) return std::unexpected(contest.error());
  std::vector<lab::PlannedRollout> plan;
  for (std::size_t method = 0; method < points.size(); ++method)
    for (std::size_t trouble = 0; trouble < kRecoveryTroubles; ++trouble)
      for (std::uint64_t seed = 1; seed <= recovery_seeds(setup); ++seed)
        plan.push_back({.task = 0, .perturbation = trouble, .method = method, .seed = seed});
  const auto done = lab::run_in_workers(*contest, plan, setup.workers, [&](const lab::RanRollout& ran) {
    const auto method = std::ranges::find(contest->panel().methods, ran.row.method, &lab::PanelMethod::name);
    RecoveryPoint& point = points.at(static_cast<std::size_t>(method - contest->panel().methods.begin()));
    ++point.rollouts;
    point.successes += ran.row.success ? 1U : 0U;
    point.violated_ticks += static_cast<double>(ran.row.constraint_violations);
    point.entries += static_cast<double>(ran.row.safety.entered_degraded);
    ++work.rollouts;
    --work.later_rollouts;
    if (setup.on_progress)
      setup.on_progress({work.rollouts, work.rollouts + work.later_rollouts,
                         fmt::format("recover_after {:g} ms", point.recover_after.milliseconds())});
    return std::expected<void, std::string>{};
  });
  if (!done) return std::unexpected(done.error());
  for (RecoveryPoint& point : points) {
    point.violated_ticks /= static_cast<double>(point.rollouts);
    point.entries /= static_cast<double>(point.rollouts);
  }
  found.recovery = best_of(points);
  found.recoveries = std::move(points);
  return {};
}

}  // namespace

std::expected<AgeTolerance, std::string> age_tolerance(const ToleranceSetup& setup) {
  const auto robot = config::load(setup.robot_file);
  if (!robot) return std::unexpected(robot.error());
  AgeTolerance found;
  Work work;
  work.later_rollouts = recovery_rollouts(setup);
  if (auto done = find_age(setup, *robot, work, found); !done) return std::unexpected(done.error());
  if (found.max_age_ms <= 0) return found;
  if (auto done = find_share(setup, *robot, work, found); !done) return std::unexpected(done.error());
  if (auto done = find_silence(setup, *robot, work, found); !done) return std::unexpected(done.error());
  if (auto done = find_recovery(setup, *robot, work, found); !done) return std::unexpected(done.error());
  return found;
}

}  // namespace takt::study
