// SPDX-License-Identifier: Apache-2.0
// What an operator is told: why arming is refused, joint by name, and which causes keep a stop latched. Pure.
#pragma once

#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/pipeline/tick_config.hpp"
#include "executive/runtime/bus_shares.hpp"

namespace takt::runtime {

// What the service thread knows and the tick does not.
struct ArmingSituation {
  const BusShares* buses = nullptr;  // null: the ticks before this one are not known
  bool policy_attached = false;      // the one in charge
  bool realtime = false;
  bool allow_non_realtime = false;
  bool shutting_down = false;
  bool policy_in_file = true;  // the robot file has a `policy`
};

// One sentence each; empty: may be armed.
std::vector<std::string> missing_for_arming(const TickRecord& latest, const pipeline::TickConfig& config,
                                            const config::RobotConfig& robot, const ArmingSituation& situation);

// Of these the faults that drives report.
std::vector<std::string> drive_faults(const TickRecord& latest, const pipeline::TickConfig& config,
                                      const config::RobotConfig& robot);

// Why a reset is refused while the robot moves: names the fastest of the joints that are `asked` to rest.
std::string still_moves(const TickRecord& latest, JointMask asked, const pipeline::TickConfig& config,
                        const std::vector<config::Joint>& joints);

// Why no policy can give a usable command: what its observations lack, by joint or sensor. Empty: they lack nothing.
std::string lack_of_observations(const TickRecord& latest, const pipeline::TickConfig& config,
                                 const config::RobotConfig& robot);

// "drive_fault, bus_off": names of the causes that hold in this tick.
std::string active_causes(const TickRecordHeader& tick);

}  // namespace takt::runtime
