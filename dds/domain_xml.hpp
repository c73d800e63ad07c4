// SPDX-License-Identifier: Apache-2.0
// The robot file's `dds` section in Cyclone DDS's words. Nothing else configures it: CYCLONEDDS_URI is not read.
#pragma once

#include <array>
#include <string>

#include "config/robot_config.hpp"

namespace takt::dds {

// What dds.security holds, under the names that ROS 2's `ros2 security` gives an enclave.
inline constexpr std::array<const char*, 6> kSecurityFiles{
    "identity_ca.cert.pem", "cert.pem", "key.pem", "permissions_ca.cert.pem", "governance.p7s", "permissions.p7s"};

// Precondition: interface, addresses and paths were checked by config::load. `plugins`: folder of Cyclone's security
// plugins; empty: the loader finds them.
std::string domain_xml(const config::Dds& dds, const std::string& plugins = "");

}  // namespace takt::dds
