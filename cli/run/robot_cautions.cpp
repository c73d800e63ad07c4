// SPDX-License-Identifier: Apache-2.0
#include "cli/command.hpp"
#include "cli/run/checked_robot.hpp"
#include "config/cautions.hpp"
#include "config/dds_security.hpp"
#include "evidence/attestation/attestation.hpp"

namespace takt::cli {

std::vector<std::string> cautions_of(const config::RobotConfig& robot) {
  std::vector<std::string> lines = config::cautions_about(robot);
  if (const std::string why = robot.dds ? config::unreadable_security_file(*robot.dds) : std::string(); !why.empty())
    lines.push_back(why + "; until then nothing is told over DDS");
  const evidence::Standing standing = evidence::standing_of(robot);
  lines.insert(lines.end(), standing.not_shown.begin(), standing.not_shown.end());
  return lines;
}

void tell_cautions(const config::RobotConfig& robot) {
  for (const std::string& caution : cautions_of(robot)) note("note", caution);
}

}  // namespace takt::cli
