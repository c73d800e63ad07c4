// SPDX-License-Identifier: Apache-2.0
// Where a running robot's sockets live, given its runtime directory.
#pragma once

#include <string>

namespace takt::config {

// The runtime directory of the one robot that the systemd units run.
inline constexpr const char* kServiceRuntimeDirectory = "/run/takt";
// Where a user's robots have their runtime directories, one folder per robot: $XDG_RUNTIME_DIR/takt; where that is not
// set, /run/takt for root, and for others takt in /run/user/UID where there is one, else /tmp/takt-UID.
std::string runtime_home();
// The robot's folder in runtime_home().
std::string default_runtime_directory(const std::string& robot);

inline std::string executive_socket(const std::string& runtime_directory) {
  return runtime_directory + "/executive.sock";
}
inline std::string sensor_socket(const std::string& runtime_directory, const std::string& sensor) {
  return runtime_directory + "/sensor-" + sensor + ".sock";
}
inline std::string loopback_socket(const std::string& runtime_directory, const std::string& interface) {
  return runtime_directory + "/can-" + interface + ".sock";
}

// What `takt doctor --keep` found out about this machine; manifests of later runs quote it.
inline std::string doctor_verdict(const std::string& record_directory) {
  return record_directory + "/doctor.json";
}

}  // namespace takt::config
