// SPDX-License-Identifier: Apache-2.0
// Reads this machine: the only part of the doctor that touches files, limits and processes. What is absent or cannot be
// read stays empty in the snapshot; nothing here fails. Thread rule: any one thread.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "systemd/doctor/snapshot.hpp"

namespace takt::doctor {

struct Sources {
  std::string root;  // before /proc, /sys, /dev, /etc and /usr: empty, but for tests
  std::function<drivers::CanLink(const std::string& interface)> can_link = drivers::read_can_link;
};

// `robot`: may be null.
Snapshot collect(const Sources& sources, const config::RobotConfig* robot);

// "0-2,5" as the kernel writes lists of processors; malformed parts are left out.
std::vector<int> cpu_list(const std::string& text);

}  // namespace takt::doctor
