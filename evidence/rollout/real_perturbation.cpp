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

#include "evidence/rollout/plant_scenario.hpp"
#include "evidence/rollout/random.hpp"
#include "evidence/rollout/wake_ups.hpp"
#include "policy_host/host_faults.hpp"
#include "simulation/scenario.hpp"

namespace takt::evidence {
namespace {

constexpr std::uint64_t kPreemptionStream = 701;
// A core that is taken for longer belongs to the hog, and the kernel's RT throttling would be what is measured.
constexpr double kLongestPreemption_ms = 50;

using Answer = std::expected<RealTrouble, std::string>;

std::string_view name_of(const Perturbation& perturbation) {
  return perturbation_kinds()[static_cast<std::size_t>(perturbation.trouble)].name;
}

Answer refuse(const Perturbation& perturbation, const std::string& why) {
  return std::unexpected(fmt::format("{}: {}", name_of(perturbation), why));
}

std::string microseconds_text(Duration time) {
  return fmt::format("{}us", time.ns / 1000);
}

Duration length_of(const Perturbation& perturbation) {
  return {std::llround(perturbation.dose * 1e6)};
}

std::string action(Duration at, const std::string& what) {
  return microseconds_text(at) + ": " + what;
}

// Once per second of the window.
std::vector<std::string> repeated(const Perturbation& perturbation, const std::string& what) {
  std::vector<std::string> actions;
  for (Duration at; at < perturbation.length; at = at + kRepeat)
    actions.push_back(action(perturbation.from + at, what));
  return actions;
}

std::vector<Duration> preemption_instants(const Perturbation& perturbation, std::uint64_t seed) {
  Random random(seed, kPreemptionStream);
  std::vector<Duration> instants;
  const auto count = static_cast<std::size_t>(std::llround(perturbation.length.seconds() * kPreemptionsPerSecond));
  for (std::size_t i = 0; i < count; ++i)
    instants.push_back(
        {perturbation.from.ns + std::llround(random.between(0, static_cast<double>(perturbation.length.ns)))});
  std::ranges::sort(instants, {}, &Duration::ns);
  return instants;
}

std::vector<Duration> hog_instants(const Perturbation& perturbation, std::uint64_t seed) {
  const Duration first{std::llround(static_cast<double>(kHogEvery.ns) * stop_phase(seed))};
  std::vector<Duration> instants;
  for (Duration at = first; at < perturbation.length; at = at + kHogEvery) instants.push_back(perturbation.from + at);
  return instants;
}

Answer hogs_at(const std::vector<Duration>& instants, const Perturbation& perturbation,
               const config::RobotConfig& robot) {
  if (!robot.control.cpu) return refuse(perturbation, "`control.cpu` is none, so no core is the control thread's");
  if (perturbation.dose > kLongestPreemption_ms)
    return refuse(perturbation, fmt::format("with real processes at most {} ms", kLongestPreemption_ms));
  std::vector<std::string> actions;
  for (const Duration at : instants)
    actions.push_back(action(at, "hog control " + microseconds_text(length_of(perturbation))));
  return RealTrouble{.actions = std::move(actions)};
}

// Milliseconds of every second that the kernel keeps for ordinary processes; 0: none.
double kernel_keeps_ms() {
  double period_us = 0, runtime_us = -1;
  std::ifstream("/proc/sys/kernel/sched_rt_period_us") >> period_us;
  std::ifstream("/proc/sys/kernel/sched_rt_runtime_us") >> runtime_us;
  return period_us > 0 && runtime_us >= 0 ? 1e3 * (period_us - runtime_us) / period_us : 0;
}

Answer throttling(const Perturbation& perturbation, const config::RobotConfig& robot) {
  if (!robot.control.cpu) return refuse(perturbation, "`control.cpu` is none, so no core is the control thread's");
  const double keeps_ms = kernel_keeps_ms();
  if (keeps_ms <= 0)
    return refuse(perturbation, "this kernel lets real-time threads have everything (kernel.sched_rt_runtime_us)");
  if (std::abs(perturbation.dose - keeps_ms) > 0.5)
    return refuse(perturbation, fmt::format("this kernel keeps {} ms of every second for ordinary processes "
                                            "(kernel.sched_rt_runtime_us); no other dose is to be had",
                                            keeps_ms));
  return RealTrouble{
      .actions = {action(perturbation.from, "throttle control " + microseconds_text(perturbation.length))}};
}

// Which program can keep this GPU busy, only its owner knows.
Answer gpu_load(const Perturbation& perturbation) {
  constexpr std::array kDevices{"/dev/nvidia0", "/dev/kfd", "/dev/dri/renderD128"};
  const bool has_gpu = std::ranges::any_of(kDevices, [](const char* path) { return std::filesystem::exists(path); });
  if (!has_gpu) return refuse(perturbation, fmt::format("no GPU here: none of {}", fmt::join(kDevices, ", ")));
  if (perturbation.load.empty())
    return refuse(perturbation, "name the command that keeps the GPU busy, such as `load: ./burn`");
  return RealTrouble{
      .actions = {action(perturbation.from, fmt::format("load {} {} {}", std::llround(perturbation.dose),
                                                        microseconds_text(perturbation.length), perturbation.load))}};
}

Answer crowd(const Perturbation& perturbation) {
  const auto more = std::llround(perturbation.dose) - 1;
  if (more < 1 || more > 64) return refuse(perturbation, "with real processes the factor is from 2 to 65");
  return RealTrouble{.actions = {action(perturbation.from, fmt::format("crowd policy {} {}", more,
                                                                       microseconds_text(perturbation.length)))}};
}

Answer policy_fault(const Perturbation& perturbation) {
  const Duration dose = length_of(perturbation);
  const std::string text = fmt::format(
      "{} us for {} us: {} {}", perturbation.from.ns / 1000, perturbation.length.ns / 1000, name_of(perturbation),
      perturbation.trouble == Trouble::publish_delay ? fmt::format("{} us", dose.ns / 1000)
                                                     : fmt::format("{}", perturbation.dose));
  if (!policy_host::parse_host_faults(std::array{text}))
    return refuse(perturbation, "the policy host cannot do that dose; see takt-policy-host --help");
  return RealTrouble{.policy_faults = {text}};
}

Answer stalls(const Perturbation& perturbation) {
  if (length_of(perturbation) >= kRepeat)
    return refuse(perturbation, "a stall per second must be shorter than a second");
  return RealTrouble{.actions = repeated(perturbation, "hog policy " + microseconds_text(length_of(perturbation)))};
}

// What the simulator cannot play, its own reader refuses.
Answer played(const Perturbation& perturbation, std::string scenario, const config::RobotConfig& robot) {
  const auto readable = simulation::parse_scenario(scenario, "scenario", robot);
  if (!readable) return refuse(perturbation, "the simulator cannot play it: " + readable.error());
  return RealTrouble{.plant_scenario = std::move(scenario)};
}

}  // namespace

std::expected<RealTrouble, std::string> real_trouble_of(const Perturbation& perturbation,
                                                        const config::RobotConfig& robot, std::uint64_t seed) {
  if (!perturbation.with.empty()) return refuse(perturbation, "its `with` acts in virtual time only");
  const Duration from = perturbation.from, dose = length_of(perturbation);
  switch (perturbation.trouble) {
    case Trouble::none:
      return RealTrouble{};
    case Trouble::policy_crash:
      return RealTrouble{.actions = {action(from, "kill policy"), action(from + dose, "start policy")}};
    case Trouble::policy_freeze:
      return RealTrouble{.actions = {action(from, "freeze policy " + microseconds_text(dose))}};
    case Trouble::inference_stall:
      return stalls(perturbation);
    case Trouble::inference_mean_shift:
      return crowd(perturbation);
    case Trouble::scheduler_preemption:
      return hogs_at(preemption_instants(perturbation, seed), perturbation, robot);
    case Trouble::cpu_hog:
      return hogs_at(hog_instants(perturbation, seed), perturbation, robot);
    case Trouble::rt_throttling:
      return throttling(perturbation, robot);
    case Trouble::can_loss:
    case Trouble::can_delay:
    case Trouble::bus_off:
      return played(perturbation, bus_scenario(perturbation, robot), robot);
    case Trouble::feedback_frozen:
    case Trouble::feedback_repeated:
    case Trouble::feedback_reversed:
    case Trouble::feedback_jump:
    case Trouble::feedback_scale:
      return played(perturbation, feedback_scenario(perturbation, robot, seed), robot);
    case Trouble::sensor_burst:
    case Trouble::sensor_dropout:
    case Trouble::camera_freeze:
    case Trouble::sensor_lies:
      if (simulated_sensors(robot).empty())
        return refuse(perturbation, "the simulator plays none of the robot's sensors");
      return played(perturbation, sensor_scenario(perturbation, robot), robot);
    case Trouble::push:
    case Trouble::payload:
    case Trouble::friction:
      return played(perturbation, body_scenario(perturbation, seed), robot);
    case Trouble::queue_growth:
    case Trouble::publish_delay:
    case Trouble::bad_actions_nan:
    case Trouble::bad_actions_range:
    case Trouble::wrong_joint_order:
      return policy_fault(perturbation);
    case Trouble::estimator_delay:
      return refuse(perturbation, "the executive decodes replies itself, and nothing outside can make it slower");
    case Trouble::gpu_contention:
      return gpu_load(perturbation);
    case Trouble::operator_stop:
      return RealTrouble{.actions = {action(from, "stop")}};
  }
  return RealTrouble{};
}

}  // namespace takt::evidence
