// SPDX-License-Identifier: Apache-2.0
// The keys of a robot file: their names, units, ranges, defaults and meaning, declared once.
#pragma once

#include "config/fields.hpp"
#include "config/robot_config.hpp"

namespace takt::config {

inline constexpr std::string_view kSchemaName = "takt.robot/1";
// Canonical texts leave defaults out and name this instead: where one changes, every robot's hash does. A new key with
// a default changes none.
inline constexpr std::int64_t kDefaultsRevision = 1;

// Walks every key of `robot`: a reader fills it, a writer prints it, the key table lists it.
void describe(Fields& fields, RobotConfig& robot);

// Parts of it, by topic.
void describe_timing(Fields& fields, RobotConfig& robot);           // control, freshness, feedback, bus_faults
void describe_machine(Fields& fields, RobotConfig& robot);          // buses, joints, model, safety
void describe_drive(Fields& fields, Drive& drive, JointKind kind);  // joints[].drive
void describe_bus(Fields& fields, Bus& bus);                        // buses[]
void describe_physics(Fields& fields, Simulation& simulation);      // simulation, without camera and target
void describe_policy(Fields& fields, RobotConfig& robot);           // sensors, policy, fallbacks, degraded
void describe_evidence(Fields& fields, RobotConfig& robot);         // record, dds, simulation

std::vector<std::string_view> joint_names(const RobotConfig& robot);

}  // namespace takt::config
