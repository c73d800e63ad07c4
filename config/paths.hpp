// Where a running robot's sockets live, given its runtime directory (default /run/takt/<robot>).
#pragma once

#include <string>

namespace takt::config {

inline std::string default_runtime_directory(const std::string& robot) {
  return "/run/takt/" + robot;
}
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
