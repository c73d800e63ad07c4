// SPDX-License-Identifier: Apache-2.0
// What a valid robot file costs or takes on trust: told by `takt config check`, refused by its --strict alone. Pure.
#pragma once

#include <string>
#include <vector>

#include "config/robot_config.hpp"

namespace takt::config {

// Sentences of one line, none where there is nothing to say. Whether what is offered as safe was ever shown to be, is
// evidence's to say (evidence/attestation/attestation.hpp).
std::vector<std::string> cautions_about(const RobotConfig& robot);
// Its share of values that hurt in silence: key, reason, cure (cautions_values.cpp).
void add_cautions_of_values(const RobotConfig& robot, std::vector<std::string>& lines);

// Where a stop or a fault would damp the robot to rest, each joint brakes and holds instead: without a `model` damping
// would let it fall. Not of a robot that can fall over (it has an `imu`), which stiff joints do not keep on its feet.
bool holds_at_once(const RobotConfig& robot);
// What the stops of a robot without a `model` do, in one line; empty: it has one.
std::string stops_without_model(const RobotConfig& robot);

// What a robot that can fall (it has an `imu`) is to stay on its feet by: the fallback of degraded mode, and every stop
// that neither damps nor only comes to rest.
struct Offer {
  std::string of;        // "fallbacks.stand", "stops.operator_stop"
  std::string what;      // "a posture", "hold", "the fallback policy"
  std::string shown_by;  // absolute path of an attestation; "none": there is none
};
std::vector<Offer> offered_as_safe(const RobotConfig& robot);

}  // namespace takt::config
