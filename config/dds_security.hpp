// SPDX-License-Identifier: Apache-2.0
// What the folder `dds.security` of a robot file holds.
#pragma once

#include <array>
#include <string>

#include "config/robot_config.hpp"

namespace takt::config {

// Under the names that ROS 2's `ros2 security` gives an enclave.
inline constexpr std::array<const char*, 6> kSecurityFiles{
    "identity_ca.cert.pem", "cert.pem", "key.pem", "permissions_ca.cert.pem", "governance.p7s", "permissions.p7s"};

// The first of them that this process cannot read, and why, in one sentence; empty: all can be, or none is asked for.
std::string unreadable_security_file(const Dds& dds);

}  // namespace takt::config
