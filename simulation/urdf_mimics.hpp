// SPDX-License-Identifier: Apache-2.0
// A URDF's <mimic joint="OTHER" multiplier="1" offset="0"/>, which MuJoCo 2.2.2 passes over. Pure.
#pragma once

#include <string>
#include <vector>

namespace takt::simulation {

struct Mimic {
  std::string joint, follows;
  double multiplier = 1, offset = 0;
};

// None in an MJCF. A number that cannot be read counts as its default.
std::vector<Mimic> mimics_of(const std::string& text);

// The same as an <equality> section of an MJCF; empty: there are none.
std::string mimics_as_equalities(const std::string& text);

}  // namespace takt::simulation
