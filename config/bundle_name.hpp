// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace takt::config {

// True of a policy's file that is called as a LEAPP bundle's YAML is; its networks lie beside it.
constexpr bool names_bundle(std::string_view policy_file) {
  return policy_file.ends_with(".yaml") || policy_file.ends_with(".yml");
}

}  // namespace takt::config
