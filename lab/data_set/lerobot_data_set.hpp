// SPDX-License-Identifier: Apache-2.0
// A LeRobot data set, format v3.0, of the episodes of one robot's runs:
//
//   meta/info.json, meta/stats.json, meta/tasks.parquet, meta/episodes/chunk-000/file-000.parquet
//   data/chunk-000/file-000.parquet   one row group per episode; further files from 100 MB on
//   meta/takt.json                    of each episode: run, ticks, hashes of configuration and of the policy that moved
//   it
//
// Features: observation.state and action (float32, names "JOINT.pos", "JOINT.vel", "JOINT.torque", with `units`),
// timestamp (float32, frame_index / fps), frame_index, episode_index, index, task_index (int64). No images: runs hold
// none. Source: github.com/huggingface/lerobot, src/lerobot/datasets.
#pragma once

#include <expected>
#include <span>
#include <string>

#include "lab/data_set/episode.hpp"

namespace takt::data_set {

// Whole frames per second, as the format wants them; 0: slower than one in two seconds.
std::int64_t frames_per_second(Duration period);

inline constexpr std::size_t kDataFileBytes = std::size_t{100} << 20U;  // no episode begins behind it

// Makes `folder`, parents included, whole or not at all: it is written beside its place and moved there.
// Preconditions: one run at least; difference() of any two robots is empty; frames_per_second() is not 0. Errors are
// one sentence: the folder exists, or cannot be written.
std::expected<void, std::string> write_lerobot(std::span<const RunEpisodes> runs, const std::string& task,
                                               const std::string& folder, std::size_t data_file_bytes = kDataFileBytes);

}  // namespace takt::data_set
