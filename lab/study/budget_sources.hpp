// SPDX-License-Identifier: Apache-2.0
// What the stages of a loop take, read from where it is known: a robot file, a recorded run. Errors: one sentence.
#pragma once

#include <expected>
#include <string>

#include "config/robot_config.hpp"
#include "drivers/protocol/bus_load.hpp"
#include "lab/study/budget.hpp"
#include "monitor/judge/run_metrics.hpp"
#include "monitor/record/recorded_run.hpp"

namespace takt::study {

// figure_stages() with what the robot file knows better: perception from the simulated camera's delay and jitter,
// actuation from the fullest bus and the simulated drive's torque delay. A robot file says nothing about inference and
// planning. The usual rates and the policy's own; max_age of the contract.
Question question_of(const config::RobotConfig& robot, std::span<const drivers::BusLoad> loads);

// Measured p50 and p99 of the commands' stages at first use, which is also where the total comes from, and of the tick.
// sense, queue and publish are mostly waiting and count as such. The error: no command of the run was ever used.
std::expected<Question, std::string> question_of(const monitor::RecordedRun& run, const monitor::RunMetrics& metrics);

// The policy's rate; without a policy 50 Hz, the figure's.
double focus_Hz_of(const config::RobotConfig& robot);

}  // namespace takt::study
