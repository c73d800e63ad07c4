// SPDX-License-Identifier: Apache-2.0
// The robot file for editors: a JSON Schema (draft 2020-12) made from the same declarations as the reader. It knows
// every key with its sentence, type, unit and words; what depends on other keys (which are required, ranges of
// quantities with units, names) only the loader judges, so that no valid file is ever marked wrong.
#pragma once

#include <string>

namespace takt::config {

// Indented, with a trailing newline.
std::string json_schema();

}  // namespace takt::config
