// A panel's perturbation where processes are real: what `takt run` and `takt-plant` are told to do to the robot. Not
// every perturbation has a mechanism there; those that have none are refused by name, never silently left out.
//
// policy_crash, policy_freeze   SIGKILL and a new process; SIGSTOP and SIGCONT
// inference_stall               real-time hogs on every core, below the control thread and above the policy host
// inference_mean_shift          dose - 1 ordinary processes beside the policy host on every core
// scheduler_preemption          a hog above the control thread's priority on its core, at instants drawn from the seed
// can_loss, can_delay, bus_off  the simulator's scenario (docs/plant-scenarios.md)
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "monitor/panel/perturbation.hpp"

namespace takt::panel {

struct RealTrouble {
  std::vector<std::string> actions;  // of `takt run --at`, times since tracking began
  std::string plant_scenario;        // text of a scenario file, times since the drives were enabled; empty: none
};

bool has_real_mechanism(Trouble trouble);
// `trouble` has one. The error: one sentence, why this dose cannot be given to this robot.
std::expected<RealTrouble, std::string> real_trouble_of(const Perturbation& perturbation,
                                                        const config::RobotConfig& robot, std::uint64_t seed);

}  // namespace takt::panel
