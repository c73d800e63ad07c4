#include "monitor/panel/real_perturbation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "monitor/panel/random.hpp"

namespace takt::panel {
namespace {

constexpr std::uint64_t kPreemptionStream = 701;
constexpr double kPreemptionsPerSecond = 10;
// A core that is taken for longer belongs to the hog, and the kernel's RT throttling would be what is measured.
constexpr double kLongestPreemption_ms = 50;

std::string microseconds_text(Duration time) {
  return fmt::format("{}us", time.ns / 1000);
}

Duration dose_time(const Perturbation& perturbation) {
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

std::vector<std::string> preemptions(const Perturbation& perturbation, std::uint64_t seed) {
  Random random(seed, kPreemptionStream);
  std::vector<Duration> instants;
  const auto count = static_cast<std::size_t>(std::llround(perturbation.length.seconds() * kPreemptionsPerSecond));
  for (std::size_t i = 0; i < count; ++i)
    instants.push_back(
        {perturbation.from.ns + std::llround(random.between(0, static_cast<double>(perturbation.length.ns)))});
  std::ranges::sort(instants, {}, &Duration::ns);
  std::vector<std::string> actions;
  for (const Duration at : instants)
    actions.push_back(action(at, "hog control " + microseconds_text(dose_time(perturbation))));
  return actions;
}

std::string event_text(const Perturbation& perturbation, const std::string& target, const std::string& fault,
                       Duration length) {
  return fmt::format("  - {{ after: enabled, at: {} us, {}, {}, for: {} us }}\n", perturbation.from.ns / 1000, target,
                     fault, length.ns / 1000);
}

std::string scenario_of(const Perturbation& perturbation, const config::RobotConfig& robot) {
  std::string text = "schema: takt.scenario/1\nevents:\n";
  if (perturbation.trouble == Trouble::bus_off)
    return text +
           event_text(perturbation, "bus: " + robot.buses.front().name, "fault: bus_off", dose_time(perturbation));
  if (perturbation.trouble == Trouble::can_delay) {
    const std::string delay = fmt::format("delay: {} us", dose_time(perturbation).ns / 1000);
    for (const config::Joint& joint : robot.joints)
      text += event_text(perturbation, "joint: " + joint.name, delay, perturbation.length);
    return text;
  }
  for (const config::Bus& bus : robot.buses)
    text +=
        event_text(perturbation, "bus: " + bus.name, fmt::format("drop: {}", perturbation.dose), perturbation.length);
  return text;
}

}  // namespace

bool has_real_mechanism(Trouble trouble) {
  switch (trouble) {
    case Trouble::none:
    case Trouble::inference_stall:
    case Trouble::inference_mean_shift:
    case Trouble::policy_crash:
    case Trouble::policy_freeze:
    case Trouble::scheduler_preemption:
    case Trouble::can_loss:
    case Trouble::can_delay:
    case Trouble::bus_off:
      return true;
    case Trouble::sensor_burst:
    case Trouble::sensor_dropout:
    case Trouble::camera_freeze:
    case Trouble::estimator_delay:
    case Trouble::queue_growth:
    case Trouble::publish_delay:
    case Trouble::bad_actions_nan:
    case Trouble::bad_actions_range:
    case Trouble::wrong_joint_order:
    case Trouble::push:
    case Trouble::payload:
    case Trouble::friction:
      return false;
  }
  return false;
}

std::expected<RealTrouble, std::string> real_trouble_of(const Perturbation& perturbation,
                                                        const config::RobotConfig& robot, std::uint64_t seed) {
  const Duration dose = dose_time(perturbation);
  switch (perturbation.trouble) {
    case Trouble::policy_crash:
      return RealTrouble{{action(perturbation.from, "kill policy"), action(perturbation.from + dose, "start policy")},
                         {}};
    case Trouble::policy_freeze:
      return RealTrouble{{action(perturbation.from, "freeze policy " + microseconds_text(dose))}, {}};
    case Trouble::inference_stall:
      if (dose >= kRepeat) return std::unexpected("inference_stall: a stall per second must be shorter than a second");
      return RealTrouble{repeated(perturbation, "hog policy " + microseconds_text(dose)), {}};
    case Trouble::inference_mean_shift: {
      const auto more = std::llround(perturbation.dose) - 1;
      if (more < 1 || more > 64)
        return std::unexpected("inference_mean_shift: with real processes the factor is from 2 to 65");
      return RealTrouble{
          {action(perturbation.from, fmt::format("crowd policy {} {}", more, microseconds_text(perturbation.length)))},
          {}};
    }
    case Trouble::scheduler_preemption:
      if (!robot.control.cpu)
        return std::unexpected("scheduler_preemption: `control.cpu` is none, so no core is the control thread's");
      if (perturbation.dose > kLongestPreemption_ms)
        return std::unexpected(
            fmt::format("scheduler_preemption: with real processes at most {} ms", kLongestPreemption_ms));
      return RealTrouble{preemptions(perturbation, seed), {}};
    case Trouble::can_loss:
    case Trouble::can_delay:
    case Trouble::bus_off:
      return RealTrouble{{}, scenario_of(perturbation, robot)};
    case Trouble::none:
    case Trouble::sensor_burst:
    case Trouble::sensor_dropout:
    case Trouble::camera_freeze:
    case Trouble::estimator_delay:
    case Trouble::queue_growth:
    case Trouble::publish_delay:
    case Trouble::bad_actions_nan:
    case Trouble::bad_actions_range:
    case Trouble::wrong_joint_order:
    case Trouble::push:
    case Trouble::payload:
    case Trouble::friction:
      return RealTrouble{};
  }
  return RealTrouble{};
}

}  // namespace takt::panel
