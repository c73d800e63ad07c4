// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/real_perturbation.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <utility>

#include "config/trouble/line.hpp"
#include "evidence/rollout/random.hpp"
#include "evidence/rollout/troubled_dynamics.hpp"
#include "evidence/rollout/wake_ups.hpp"
#include "simulation/scenario.hpp"

namespace takt::evidence {
namespace {

using trouble::Place;
using trouble::Row;
using trouble::When;
using trouble::Whom;

constexpr std::uint64_t kPreemptionStream = 701, kLyingJointStream = 801;
// A core that is taken for longer belongs to the hog, and the kernel's RT throttling would be what is measured.
constexpr double kLongestPreemption_ms = 50;

struct Span {
  Duration at, length;
};

std::int64_t microseconds_of(Duration time) {
  return time.ns / 1000;
}

Duration length_of(const Perturbation& perturbation) {
  return {std::llround(perturbation.dose * 1e6)};
}

// Every `period` of the window, from `first` in it.
std::vector<Span> repeated(const Perturbation& perturbation, Duration first, Duration period, Duration length) {
  std::vector<Span> spans;
  for (Duration at = first; at < perturbation.length; at = at + period)
    spans.push_back({perturbation.from + at, length});
  return spans;
}

std::vector<Span> at_random(const Perturbation& perturbation, std::uint64_t seed) {
  Random random(seed, kPreemptionStream);
  std::vector<Span> spans;
  const auto count = static_cast<std::size_t>(std::llround(perturbation.length.seconds() * kPreemptionsPerSecond));
  for (std::size_t i = 0; i < count; ++i)
    spans.push_back(
        {{perturbation.from.ns + std::llround(random.between(0, static_cast<double>(perturbation.length.ns)))},
         length_of(perturbation)});
  std::ranges::sort(spans, {}, [](const Span& span) { return span.at.ns; });
  return spans;
}

std::vector<Span> spans_of(const Perturbation& perturbation, std::uint64_t seed) {
  const Duration dose = length_of(perturbation);
  const auto within_the_window = [&](Duration length) {
    std::vector<Span> spans = repeated(perturbation, {}, kRepeat, length);
    for (Span& span : spans) span.length = std::min(span.length, perturbation.length - (span.at - perturbation.from));
    return spans;
  };
  switch (row_of(perturbation.trouble).real.when) {
    case When::window:
      return {{perturbation.from, perturbation.length}};
    case When::once:
    case When::for_dose:
      return {{perturbation.from, dose}};
    case When::each_second:
      return repeated(perturbation, {}, kRepeat, dose);
    case When::each_second_within:
      return within_the_window(dose);
    case When::push_each_second:
      return within_the_window(kPushLength);
    case When::each_tenth_of_a_second:
      return repeated(perturbation, {std::llround(static_cast<double>(kHogEvery.ns) * stop_phase(seed))}, kHogEvery,
                      dose);
    case When::at_random:
      return at_random(perturbation, seed);
  }
  return {};
}

// Milliseconds of every second that the kernel keeps for ordinary processes; 0: none.
double kernel_keeps_ms() {
  double period_us = 0, runtime_us = -1;
  std::ifstream("/proc/sys/kernel/sched_rt_period_us") >> period_us;
  std::ifstream("/proc/sys/kernel/sched_rt_runtime_us") >> runtime_us;
  return period_us > 0 && runtime_us >= 0 ? 1e3 * (period_us - runtime_us) / period_us : 0;
}

std::string refused_by_kernel(double dose_ms) {
  const double keeps_ms = kernel_keeps_ms();
  if (keeps_ms <= 0) return "this kernel lets real-time threads have everything (kernel.sched_rt_runtime_us)";
  if (std::abs(dose_ms - keeps_ms) <= 0.5) return {};
  return fmt::format(
      "this kernel keeps {} ms of every second for ordinary processes (kernel.sched_rt_runtime_us); no other dose is "
      "to be had",
      keeps_ms);
}

// Which program can keep this GPU busy, only its owner knows.
std::string without_gpu(const Perturbation& perturbation) {
  constexpr std::array kDevices{"/dev/nvidia0", "/dev/kfd", "/dev/dri/renderD128"};
  const bool has_gpu = std::ranges::any_of(kDevices, [](const char* path) { return std::filesystem::exists(path); });
  if (!has_gpu) return fmt::format("no GPU here: none of {}", fmt::join(kDevices, ", "));
  return perturbation.load.empty() ? "name the command that keeps the GPU busy, such as `load: ./burn`" : "";
}

// So many times as long: beside one, as many as it takes.
std::int64_t copies_of(const Perturbation& perturbation) {
  const bool is_factor = row_of(perturbation.trouble).dose.unit == "factor";
  return std::llround(perturbation.dose) - (is_factor ? 1 : 0);
}

std::string refused_by_crowd(const Perturbation& perturbation) {
  const config::Range range = row_of(trouble::ActionKind::crowd).dose.range();
  if (range.contains(static_cast<double>(copies_of(perturbation)))) return {};
  return fmt::format("with real processes the factor is from {} to {}", range.low + 1, range.high + 1);
}

// What stands in the way on this machine, or with this robot; empty: nothing.
std::string obstacle(const Perturbation& perturbation, const config::RobotConfig& robot) {
  const trouble::Real& real = row_of(perturbation.trouble).real;
  if (real.by == Place::panel) return std::string(real.as);
  if (real.as.ends_with(" control") && !robot.control.cpu)
    return "`control.cpu` is none, so no core is the control thread's";
  if (real.as == "hog control" && perturbation.dose > kLongestPreemption_ms)
    return fmt::format("with real processes at most {} ms", kLongestPreemption_ms);
  if (real.when == When::each_second && length_of(perturbation) >= kRepeat)
    return "what comes once per second must be shorter than a second";
  if (real.whom == Whom::each_sensor && simulated_sensors(robot).empty())
    return "the simulator plays none of the robot's sensors";
  if (real.as == "crowd policy") return refused_by_crowd(perturbation);
  if (real.as == "throttle control") return refused_by_kernel(perturbation.dose);
  return real.as == "load" ? without_gpu(perturbation) : "";
}

// In the words of the mechanism's row, times in microseconds: " 6", "4000 us".
std::string dose_text(const Perturbation& perturbation, const Row& mechanism) {
  const config::Dimension dimension = mechanism.dose.dimension();
  if (dimension == config::Dimension::time) return fmt::format("{} us", microseconds_of(length_of(perturbation)));
  if (dimension != config::Dimension::none) return fmt::format("{} {}", perturbation.dose, mechanism.dose.unit);
  if (!mechanism.dose.whole) return fmt::format("{}", perturbation.dose);
  return fmt::format("{}", copies_of(perturbation));
}

std::vector<std::string> actions_of(const Perturbation& perturbation, const std::vector<Span>& spans) {
  const trouble::Real& real = row_of(perturbation.trouble).real;
  const Row& mechanism = *trouble::find(Place::run, real.as.substr(0, real.as.find(' ')));
  std::vector<std::string> actions;
  for (const Span& span : spans) {
    std::string& action = actions.emplace_back(fmt::format("{}us: {}", microseconds_of(span.at), real.as));
    if (!mechanism.dose.unit.empty()) action += " " + dose_text(perturbation, mechanism);
    if (mechanism.longest.ns > 0) action += fmt::format(" {}us", microseconds_of(span.length));
    if (mechanism.takes_command) action += " " + perturbation.load;
  }
  if (!real.then.empty())
    actions.push_back(fmt::format("{}us: {}", microseconds_of(perturbation.from + length_of(perturbation)), real.then));
  return actions;
}

std::string host_fault(const Perturbation& perturbation) {
  const Row& mechanism = *trouble::find(Place::policy_host, row_of(perturbation.trouble).real.as);
  return fmt::format("{} us for {} us: {} {}", microseconds_of(perturbation.from), microseconds_of(perturbation.length),
                     mechanism.name, dose_text(perturbation, mechanism));
}

// As keys of an event: "joint: elbow, ". The body has none.
std::vector<std::string> targets_of(Whom whom, const config::RobotConfig& robot, std::uint64_t seed) {
  std::vector<std::string> keys;
  if (whom == Whom::each_joint)
    for (const config::Joint& joint : robot.joints) keys.push_back("joint: " + joint.name + ", ");
  if (whom == Whom::one_joint) keys.push_back("joint: " + robot.joints[lying_joint(robot, seed)].name + ", ");
  if (whom == Whom::each_bus)
    for (const config::Bus& bus : robot.buses) keys.push_back("bus: " + bus.name + ", ");
  if (whom == Whom::first_bus) keys.push_back("bus: " + robot.buses.front().name + ", ");
  if (whom == Whom::each_sensor)
    for (const std::string& name : simulated_sensors(robot)) keys.push_back("sensor: " + name + ", ");
  if (whom == Whom::body) keys.emplace_back();
  return keys;
}

// Text of a scenario file, times since the drives were enabled.
std::string scenario_of(const Perturbation& perturbation, const std::vector<Span>& spans,
                        const config::RobotConfig& robot, std::uint64_t seed) {
  const trouble::Real& real = row_of(perturbation.trouble).real;
  const Row& mechanism = *trouble::find(Place::plant, real.as);
  const bool is_plain = mechanism.dose.unit.empty();
  const std::string what =
      is_plain ? fmt::format("fault: {}", real.as) : fmt::format("{}: {}", real.as, dose_text(perturbation, mechanism));
  std::string text = "schema: takt.scenario/1\nevents:\n";
  for (const std::string& target : targets_of(real.whom, robot, seed)) {
    std::int64_t turn = 0;
    for (const Span& span : spans) {
      std::string body;
      if (real.when == When::push_each_second)
        body = fmt::format(", along: [{}]", fmt::join(push_direction(seed, ++turn), ", "));
      if (!perturbation.body.empty()) body += ", body: " + perturbation.body;
      text += fmt::format("  - {{ after: enabled, at: {} us, {}{}{}, for: {} us }}\n", microseconds_of(span.at), target,
                          what, body, microseconds_of(span.length));
    }
  }
  return text;
}

// What its mechanism cannot do, that one's own reader refuses.
std::string unreadable(const RealTrouble& trouble, const config::RobotConfig& robot) {
  for (const std::string& action : trouble.actions)
    if (const auto read = trouble::parse_line(action, Place::run); !read)
      return "`takt run` cannot do it: " + read.error();
  for (const std::string& fault : trouble.policy_faults)
    if (const auto read = trouble::parse_line(fault, Place::policy_host); !read)
      return "the policy host cannot do it: " + read.error();
  if (trouble.plant_scenario.empty()) return {};
  const auto read = simulation::parse_scenario(trouble.plant_scenario, "scenario", robot);
  return read ? "" : "the simulator cannot play it: " + read.error();
}

}  // namespace

std::size_t lying_joint(const config::RobotConfig& robot, std::uint64_t seed) {
  std::vector<std::size_t> driven;
  for (std::size_t j = 0; j < robot.joints.size(); ++j)
    if (!robot.joints[j].passive) driven.push_back(j);
  Random draw(simulation::seed_for(seed, kLyingJointStream), 0);
  return driven[draw.below(driven.size())];
}

std::vector<std::string> simulated_sensors(const config::RobotConfig& robot) {
  std::vector<std::string> names;
  if (!robot.simulation) return names;
  if (!robot.simulation->camera_sensor.empty()) names.push_back(robot.simulation->camera_sensor);
  if (robot.imu && robot.simulation->mujoco) names.push_back(robot.imu->sensor);
  return names;
}

std::expected<RealTrouble, std::string> real_trouble_of(const Perturbation& perturbation,
                                                        const config::RobotConfig& robot, std::uint64_t seed) {
  const Row& row = row_of(perturbation.trouble);
  const auto refuse = [&row](std::string_view why) { return std::unexpected(fmt::format("{}: {}", row.name, why)); };
  if (!perturbation.with.empty()) return refuse("its `with` acts in virtual time only");
  if (const std::string why = obstacle(perturbation, robot); !why.empty()) return refuse(why);
  const std::vector<Span> spans = spans_of(perturbation, seed);
  RealTrouble made;
  if (row.real.by == Place::run) made.actions = actions_of(perturbation, spans);
  if (row.real.by == Place::policy_host) made.policy_faults = {host_fault(perturbation)};
  if (row.real.by == Place::plant) made.plant_scenario = scenario_of(perturbation, spans, robot, seed);
  if (const std::string why = unreadable(made, robot); !why.empty()) return refuse(why);
  return made;
}

}  // namespace takt::evidence
