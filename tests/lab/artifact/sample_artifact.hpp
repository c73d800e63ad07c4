// SPDX-License-Identifier: Apache-2.0
// An artifact for tests: a manifest that sample rows fit, and whole artifacts on disk.
#pragma once

#include <string>
#include <vector>

#include "lab/artifact/artifact.hpp"

namespace takt::lab {

inline constexpr const char* kPanelText = "panel";  // what sample rows name by its hash

// Methods of the given names, seeds 1..20.
ArtifactManifest sample_manifest(const std::vector<std::string>& methods, std::uint64_t planned);
// Writes rows into a new artifact and finishes it when it holds all that `manifest` plans. Throws the sentence.
Artifact write_artifact(const std::string& path, const ArtifactManifest& manifest,
                        const std::vector<evidence::RolloutRow>& rows);

}  // namespace takt::lab
