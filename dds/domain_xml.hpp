// SPDX-License-Identifier: Apache-2.0
// The robot file's `dds` section in Cyclone DDS's words. Nothing else configures it: CYCLONEDDS_URI is not read.
#pragma once

#include <string>

#include "config/robot_config.hpp"

namespace takt::dds {

// Precondition: interface and addresses were checked by config::load.
std::string domain_xml(const config::Dds& dds);

}  // namespace takt::dds
