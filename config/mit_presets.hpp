// Ranges of the packed fields of drives that speak the MIT protocol: +-position, +-velocity, +-torque, 0..kp, 0..kd.
//
// A wrong range scales every command, and public tables conflict, so a robot file either names a model of this table
// or gives all five ranges itself. Sources: protocol tables published with TMotorCANControl (neurobionics,
// src/TMotorCANControl/mit_can.py) and openarm_can (enactic, dm_motor_constants.hpp). Units: rad, rad/s, Nm, Nm/rad,
// Nms/rad.
#pragma once

#include <array>
#include <string_view>

namespace takt::config {

struct MitPreset {
  std::string_view model;
  double position, velocity, torque, kp, kd;
};

inline constexpr std::array kMitPresets{
    MitPreset{"AK80-9", 12.5, 50, 18, 500, 5}, MitPreset{"AK10-9", 12.5, 50, 65, 500, 5},
    MitPreset{"AK60-6", 12.5, 50, 15, 500, 5}, MitPreset{"AK70-10", 12.5, 50, 25, 500, 5},
    MitPreset{"AK80-6", 12.5, 76, 12, 500, 5}, MitPreset{"AK80-64", 12.5, 8, 144, 500, 5},
    MitPreset{"DM4310", 12.5, 30, 10, 500, 5}, MitPreset{"DM4340", 12.5, 10, 28, 500, 5},
    MitPreset{"DM6006", 12.5, 45, 20, 500, 5}, MitPreset{"DM8009", 12.5, 45, 54, 500, 5},
};

constexpr const MitPreset* find_mit_preset(std::string_view model) {
  for (const MitPreset& preset : kMitPresets)
    if (preset.model == model) return &preset;
  return nullptr;
}

inline constexpr auto kMitModels = [] {
  std::array<std::string_view, kMitPresets.size()> models{};
  for (std::size_t i = 0; i < models.size(); ++i) models[i] = kMitPresets[i].model;
  return models;
}();

}  // namespace takt::config
