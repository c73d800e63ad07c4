// SPDX-License-Identifier: Apache-2.0
// What a typist most likely meant.
#pragma once

#include <span>
#include <string_view>

namespace takt::config {

// The nearest of `words`; empty when none is near.
std::string_view nearest(std::string_view typed, std::span<const std::string_view> words);

}  // namespace takt::config
