// SPDX-License-Identifier: Apache-2.0
// Judges a snapshot: what stands between this machine and a punctual control loop. Pure: no file, clock or process.
//
// fail: the executive would refuse to start, or its loop cannot be relied on; warn: it runs, later or less punctually
// than it could, or as a simulation. Every finding that is not ok says how to correct it.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "config/robot_config.hpp"
#include "systemd/doctor/snapshot.hpp"

namespace takt::doctor {

enum class Verdict : std::uint8_t { ok, warn, fail };

constexpr std::string_view name(Verdict verdict) {
  switch (verdict) {
    case Verdict::ok:
      return "ok";
    case Verdict::warn:
      return "warn";
    case Verdict::fail:
      return "fail";
  }
  return "invalid";
}

struct Finding {
  std::string check;  // stable: "kernel", "memlock", "can can0"
  Verdict verdict = Verdict::ok;
  std::string found;  // what was read
  std::string where;  // from which file, limit or command
  std::string cure;   // empty when ok
};

// `robot`: null judges the machine alone, as for control.cpu none and a period of 1 ms.
std::vector<Finding> diagnose(const Snapshot& snapshot, const config::RobotConfig* robot);

// The worst of them.
Verdict worst(const std::vector<Finding>& findings);

// One line per finding, what is to be corrected below it; histogram of the wake-ups at the end.
std::string text_of(const std::vector<Finding>& findings, const Snapshot& snapshot);
// One line: {"schema":"takt.doctor/1","verdict":...,"findings":[...],"wakeup":{...}}; wakeup.smis and .stolen_ms: null
// where they could not be counted.
std::string json_of(const std::vector<Finding>& findings, const Snapshot& snapshot);

}  // namespace takt::doctor
