// SPDX-License-Identifier: Apache-2.0
// Runs planned rollouts in worker processes and hands their rows over in the plan's order, whatever the number of
// workers: the rows of one and of many are the same bytes, host fields aside.
//
// Worker w of n takes every n-th rollout. Workers are forked once everything is loaded, so they share it; they die with
// their parent. Errors are one sentence; the first one ends all workers. Thread rule: call from a process of one
// thread.
#pragma once

#include <cstddef>
#include <expected>
#include <functional>
#include <span>
#include <string>

#include "lab/panel/panel_plan.hpp"

namespace takt::lab {

// An error ends the run.
using DeliverRow = std::function<std::expected<void, std::string>(const RanRollout&)>;
// Asked before each rollout; true ends the run, and what the workers have computed beyond it is dropped.
using IsEnough = std::function<bool()>;

std::expected<void, std::string> run_in_workers(Contest& contest, std::span<const PlannedRollout> rollouts,
                                                std::size_t workers, const DeliverRow& deliver,
                                                const IsEnough& is_enough = {});

}  // namespace takt::lab
