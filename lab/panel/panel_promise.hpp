// SPDX-License-Identifier: Apache-2.0
// What the panel file in an artifact's folder says of that artifact, for its audit.
#pragma once

#include <expected>
#include <string>

#include "lab/judge/audit.hpp"

namespace takt::lab {

// `path`: of a panel file. Robot files are not read: their paths need not lead anywhere from there. The error is one
// sentence.
std::expected<PanelPromise, std::string> panel_promise(const std::string& path);
// Of such a file's text. `name`: for the sentence.
std::expected<PanelPromise, std::string> panel_promise_of(const std::string& text, const std::string& name);

}  // namespace takt::lab
