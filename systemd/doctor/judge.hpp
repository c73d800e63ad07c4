// SPDX-License-Identifier: Apache-2.0
// Shared by the judging files of this room: what every check is given, and how it says what it found.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "systemd/doctor/diagnose.hpp"

namespace takt::doctor {

struct Case {
  const Snapshot& machine;
  const config::RobotConfig* robot;  // may be null
};

inline Finding fine(std::string check, std::string found, std::string where) {
  return {std::move(check), Verdict::ok, std::move(found), std::move(where), {}};
}
inline Finding bad(Verdict verdict, std::string check, std::string found, std::string where, std::string cure) {
  return {std::move(check), verdict, std::move(found), std::move(where), std::move(cure)};
}

inline bool contains(const std::vector<int>& list, int value) {
  return std::ranges::find(list, value) != list.end();
}

using Findings = std::vector<Finding>;
// Kernel, processors, interrupts, limits.
void judge_processor(const Case& of, Findings& into);
void judge_rights(const Case& of, Findings& into);
// What else may take the control core or slow it down.
void judge_neighbourhood(const Case& of, Findings& into);
// CAN interfaces, disk, hardware watchdog.
void judge_robot(const Case& of, Findings& into);
// Measured wake-ups, and what disturbed them unseen by the kernel: nothing where none were measured.
void judge_measurement(const Case& of, Findings& into);

// During the measurement. Absent: not counted; a virtual machine's own count, always 0, says nothing of the firmware's.
std::optional<std::uint32_t> smis_counted(const Snapshot& machine);

}  // namespace takt::doctor
