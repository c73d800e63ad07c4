// SPDX-License-Identifier: Apache-2.0
// What no single key can know: relations between keys. Each complaint states its formula with the numbers in it.
#pragma once

#include <string>
#include <string_view>

#include "config/document.hpp"
#include "config/reader.hpp"
#include "config/robot_config.hpp"

namespace takt::config {

// Precondition: every key was read without a complaint. Problems are added at the place of the key to correct.
void check(const RobotConfig& robot, const Places& places, Problems& problems);

// Collects complaints about keys by their path. `joints_key`: what the file calls its list of joints; paths that begin
// with "joints[" are meant, found and written by that name.
class Checker {
 public:
  Checker(const Places& places, Problems& problems, std::string joints_key = "joints")
      : places_(places), problems_(problems), joints_key_(std::move(joints_key)) {}
  // `holds` false: complains at `path`, "path: sentence".
  void require(bool holds, const std::string& path, std::string_view sentence);

 private:
  const Places& places_;
  Problems& problems_;
  std::string joints_key_;
};

void check_timing(const RobotConfig& robot, Checker& checker);
void check_buses_and_ids(const RobotConfig& robot, Checker& checker);
void check_drives(const RobotConfig& robot, Checker& checker);  // each by itself
void check_joints(const RobotConfig& robot, Checker& checker);
void check_model(const RobotConfig& robot, Checker& checker);
void check_sensors(const RobotConfig& robot, Checker& checker);
void check_policy(const RobotConfig& robot, Checker& checker);
void check_fallbacks(const RobotConfig& robot, Checker& checker);
void check_stops(const RobotConfig& robot, Checker& checker);
void check_dds(const RobotConfig& robot, Checker& checker);
void check_telemetry(const RobotConfig& robot, Checker& checker);
void check_simulation(const RobotConfig& robot, Checker& checker);

}  // namespace takt::config
