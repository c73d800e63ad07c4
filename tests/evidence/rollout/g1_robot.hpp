// Unitree's G1 as a robot file with simulated drives, from its published model and deploy.yaml where ../shared has
// them: 29 MIT drives on five buses at 500 Hz, gains and home pose as deployed, torque limits as in the model.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace takt::panel::test {

// Neither published file nor folder there: empty. Paths in it are absolute.
std::optional<std::string> g1_robot_text(const std::filesystem::path& shared = "../shared");

}  // namespace takt::panel::test
