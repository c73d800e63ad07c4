// SPDX-License-Identifier: Apache-2.0
// The table a person reads after a panel: one line per task, perturbation and method, over all seeds. Pure.
#pragma once

#include <span>
#include <string>

#include "evidence/rollout/rollout_row.hpp"

namespace takt::lab {

// Success with the exact two-sided 95 % interval of its rate; p99 age per tick, rms error, largest torque and recovery
// as medians over seeds; ticks that violated the task's constraints, stops and degradations as means.
std::string panel_table(std::span<const evidence::RolloutRow> rows);

// Where the age comes from, nominal and under stress: mean inference time, p99 of the queue's part at first use, p50,
// p95 and p99 age per tick as medians over seeds; ticks that missed the deadline, of all seeds together.
std::string latency_table(std::span<const evidence::RolloutRow> rows);

// How the reference moved: peak jerk and the largest step in velocity where a command took over, medians over seeds;
// joints per tick that touched a limit of velocity or acceleration, of all seeds together.
std::string motion_table(std::span<const evidence::RolloutRow> rows);

}  // namespace takt::lab
