// SPDX-License-Identifier: Apache-2.0
// What `takt policy try` writes: policies tried, as a page of Markdown.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "lab/policy_trial/agreement.hpp"
#include "lab/policy_trial/policy_trial.hpp"

namespace takt::cli {

inline constexpr std::size_t kMostTimedInferences = 2000;

struct TriedPolicy {
  std::filesystem::path file;  // below the folder that was searched
  policy_trial::Trial trial;
  std::optional<policy_trial::Agreement> agreement;  // nothing: not judged
};

// `judge`: its version; "": there was none. Folders of the first level have a table each, if there are several.
std::string tried_page(std::span<const TriedPolicy> tried, const std::string& judge);

}  // namespace takt::cli
