// SPDX-License-Identifier: Apache-2.0
#include "tests/process/patient_copy.hpp"

#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "config/load.hpp"

namespace takt::test {

std::string patient_copy(const std::string& robot_file, const std::string& directory,
                         const std::vector<config::Override>& changes) {
  const auto robot = config::load(robot_file);
  if (!robot) throw std::runtime_error(robot.error());
  std::vector<config::Override> patience{{"feedback.timeout", "200 ms"},
                                         {"simulation.drive_watchdog", "500 ms"},
                                         {"policy.file", robot->policy ? robot->policy->file : ""}};
  patience.insert(patience.end(), changes.begin(), changes.end());
  const auto patient = config::with_overrides(*robot, patience);
  if (!patient) throw std::runtime_error(patient.error());
  const std::string path = directory + "/" + std::filesystem::path(robot_file).filename().string();
  std::ofstream(path) << patient->resolved;
  return path;
}

}  // namespace takt::test
