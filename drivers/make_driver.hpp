// Builds the driver a joint's configuration asks for. Set-up only; the error is one sentence.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "drivers/joint_driver.hpp"

namespace takt::drivers {

std::expected<std::unique_ptr<JointDriver>, std::string> make_joint_driver(const config::Joint& joint);

}  // namespace takt::drivers
