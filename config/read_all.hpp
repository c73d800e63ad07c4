// SPDX-License-Identifier: Apache-2.0
// Reading a file to its end. std::istreambuf_iterator throws where a medium fails; this says so.
#pragma once

#include <istream>
#include <optional>
#include <string>

namespace takt::config {

// What is left of the stream; nothing: it is not open, or reading it failed.
std::optional<std::string> read_all(std::istream& stream);

}  // namespace takt::config
