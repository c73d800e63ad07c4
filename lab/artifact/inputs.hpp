// SPDX-License-Identifier: Apache-2.0
// What an artifact keeps of that from which its rows were computed, so that they can be computed anew from the artifact
// alone: robot files, policies and models, by content.
//
//   inputs.json      per task the robot file and what it names, by their paths from the robot file's folder; each by
//                    its SHA-256. What is too large, or named by a whole path, is named only (`not_kept`)
//   inputs/SHA256    the contents
//
// Errors are one sentence. Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <expected>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace takt::lab {

class ArtifactFolder;
struct Artifact;

inline constexpr const char* kInputsSchema = "takt.inputs/1";
inline constexpr const char* kInputsFile = "inputs.json";
inline constexpr const char* kKeptRobot = "robot.yaml";        // in the place of the robot file
inline constexpr std::uint64_t kLargestInput = 256ULL << 20U;  // bytes; a larger file is not kept
inline constexpr std::size_t kDeepest = 16;                    // folders above the robot file's

struct KeptInputs {
  using Hashes = std::map<std::string, std::string>;  // path -> SHA-256
  std::map<std::string, Hashes> tasks;                // by name
  Hashes not_kept;                                    // by whole path
};

bool keeps_inputs(const ArtifactFolder& folder);
// Strict. A path leads out of the robot file's folder by leading `..` alone.
std::expected<KeptInputs, std::string> read_inputs(const ArtifactFolder& folder);
std::expected<void, std::string> write_inputs(const ArtifactFolder& folder, const KeptInputs& inputs);

// Keeps the content; its SHA-256.
std::expected<std::string, std::string> keep_content(const ArtifactFolder& folder, std::string_view content);
// Refuses a content that is not the one of its name.
std::expected<std::string, std::string> kept_content(const ArtifactFolder& folder, const std::string& sha256);

// Sentences about contents that are not there, or not as they were kept.
std::vector<std::string> altered_inputs(const ArtifactFolder& folder);

// Those of all of them, into the new one; nothing where one keeps none. Refuses a path that has two contents.
std::expected<void, std::string> merge_inputs(std::span<const Artifact> from, const ArtifactFolder& to);

}  // namespace takt::lab
