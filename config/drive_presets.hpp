// SPDX-License-Identifier: Apache-2.0
// Ranges of the packed fields of drives that speak the MIT or the RobStride protocol: +-position, +-velocity, +-torque,
// 0..kp, 0..kd.
//
// A wrong range scales every command, so a number stands here only where its sources agree and are the maker's manual
// or at least two, and names them. Otherwise it is 0 (kUnsettled): the robot file must give that range itself, from the
// drive's own manual, though the model gives the others. What the sources say: config/drives/MODEL.yaml. Units: rad,
// rad/s, Nm, Nm/rad, Nms/rad.
#pragma once

#include <span>
#include <string_view>

#include "config/drive_preset_table.hpp"
#include "config/robot_config.hpp"

namespace takt::config {

constexpr std::span<const DrivePreset> presets_of(DriveProtocol protocol) {
  switch (protocol) {
    case DriveProtocol::mit:
      return kMitPresets;
    case DriveProtocol::robstride:
      return kRobstridePresets;
    case DriveProtocol::odrive:
    case DriveProtocol::moteus:
    case DriveProtocol::cia402:
      return {};
  }
  return {};
}

// `name`: the model's, or another one of the same drive (kModelAliases).
constexpr const DrivePreset* find_drive_preset(DriveProtocol protocol, std::string_view name) {
  std::string_view model = name;
  for (const ModelAlias& alias : kModelAliases)
    if (alias.name == name) model = alias.model;
  for (const DrivePreset& preset : presets_of(protocol))
    if (preset.model == model) return &preset;
  return nullptr;
}

}  // namespace takt::config
