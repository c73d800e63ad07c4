// SPDX-License-Identifier: Apache-2.0
// How pages name the test that proves a row: "PROGRAM Suite.Case", or without the program that most of them are of.
#pragma once

#include <string_view>

namespace takt::docs {

constexpr std::string_view short_name(std::string_view proof) {
  constexpr std::string_view kMost = "pipeline_test ";
  return proof.starts_with(kMost) ? proof.substr(kMost.size()) : proof;
}

}  // namespace takt::docs
