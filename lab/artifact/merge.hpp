// SPDX-License-Identifier: Apache-2.0
// Several artifacts of one panel into one: methods side by side, or the shares of several machines.
#pragma once

#include <expected>
#include <span>
#include <string>

#include "lab/artifact/artifact.hpp"

namespace takt::lab {

// Writes a new artifact at `path` with all rows, in the order given. Refuses, before anything is written, what
// compare() would refuse, a method that means different things in two of them, unfinished artifacts, and a rollout that
// is in two of them. The error is one sentence.
std::expected<Artifact, std::string> merge(const std::string& path, std::span<const Artifact> artifacts);

}  // namespace takt::lab
