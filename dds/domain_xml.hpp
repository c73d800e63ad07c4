// SPDX-License-Identifier: Apache-2.0
// The robot file's `dds` section in Cyclone DDS's words. Nothing else configures it: CYCLONEDDS_URI is not read.
#pragma once

#include <string>

#include "config/robot_config.hpp"

namespace takt::dds {

// Precondition: interface, addresses and paths were checked by config::load. `plugins`: folder of Cyclone's security
// plugins; empty: the loader finds them.
std::string domain_xml(const config::Dds& dds, const std::string& plugins = "");

}  // namespace takt::dds
