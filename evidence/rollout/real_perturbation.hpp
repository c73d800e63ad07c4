// SPDX-License-Identifier: Apache-2.0
// A panel's perturbation where processes are real: what `takt run` and its processes are told to do to the robot. Those
// that have no mechanism there are refused by name, never silently left out.
//
// policy_crash, policy_freeze   SIGKILL and a new process; SIGSTOP and SIGCONT
// inference_stall               real-time hogs on every core, below the control thread and above the policy host
// inference_mean_shift          dose - 1 ordinary processes beside the policy host on every core
// scheduler_preemption          a hog above the control thread's priority on its core, at instants drawn from the seed
// cpu_hog                       the same, every 100 ms
// rt_throttling                 a spinner below the control thread on its core, until the kernel stops both
// gpu_contention                a command of the panel's, where there is a GPU
// operator_stop                 the stop of `takt stop`
// publish_delay, queue_growth, bad_actions_nan, bad_actions_range, wrong_joint_order: the policy host, told by --fault
// can_loss, can_delay, bus_off, feedback_frozen, feedback_repeated, feedback_reversed, feedback_jump, feedback_scale,
// sensor_burst, sensor_dropout, camera_freeze, sensor_lies, push, payload, friction: the simulator, by a scenario
// (docs/plant-scenarios.md)
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "evidence/rollout/perturbation.hpp"

namespace takt::evidence {

struct RealTrouble {
  std::vector<std::string> actions = {};        // of `takt run --at`, times since tracking began
  std::string plant_scenario = {};              // text of a scenario file, times since the drives were enabled
  std::vector<std::string> policy_faults = {};  // of `takt-policy-host --fault`, times since tracking began
};

// The error: one sentence, why this perturbation, or this dose of it, cannot be given to this robot.
std::expected<RealTrouble, std::string> real_trouble_of(const Perturbation& perturbation,
                                                        const config::RobotConfig& robot, std::uint64_t seed);

}  // namespace takt::evidence
