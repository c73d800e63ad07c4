// Reads this machine: the only part of the doctor that touches files, limits and processes. What is absent or cannot be
// read stays empty in the snapshot; nothing here fails. Thread rule: any one thread; blocks for as long as `ip` takes.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "systemd/doctor/snapshot.hpp"

namespace takt::doctor {

struct Sources {
  std::string root;  // before /proc, /sys, /dev, /etc and /usr: empty, but for tests
  // Runs a command; its output, or nothing when it failed.
  std::function<std::string(const std::vector<std::string>&)> run;
};

// `robot`: may be null.
Snapshot collect(const Sources& sources, const config::RobotConfig* robot);

// "0-2,5" as the kernel writes lists of processors; malformed parts are left out.
std::vector<int> cpu_list(const std::string& text);
// Out of `ip -details -json link show NAME`.
CanInterface can_interface_of(const std::string& name, const std::string& ip_json);

}  // namespace takt::doctor
