// SPDX-License-Identifier: Apache-2.0
// A run folder, opened for review: its manifest, its configuration (which must be the one the manifest names), and its
// recorded messages in order. Works on unfinished and cut-off runs. Errors are one sentence.
#pragma once

#include <cstdint>
#include <expected>
#include <functional>
#include <string>

#include "config/robot_config.hpp"
#include "monitor/record/image_message.hpp"
#include "monitor/record/mcap_reader.hpp"
#include "monitor/record/policy_input_message.hpp"
#include "monitor/record/run_folder.hpp"
#include "monitor/record/run_messages.hpp"
#include "monitor/record/tick_schema.hpp"

namespace takt::monitor {

struct RecordedRun {
  RunFolder folder;
  RunManifest manifest;
  config::RobotConfig robot;
};
std::expected<RecordedRun, std::string> open_run(const std::string& directory);

// Ticks that were recorded, says the manifest, and are not among the `read` that the file still holds. The manifest of
// a recording that was cut off says of fewer than are there.
constexpr std::uint64_t missing_ticks(const RunManifest& manifest, std::uint64_t read) {
  return manifest.ticks > read ? manifest.ticks - read : 0;
}

// How the ticks of a file are laid out other than this version lays them out, by fields of tick_schema().
struct OtherTickLayout {
  std::vector<std::string> lacking;  // zero in every tick
  std::vector<std::string> unknown;  // of the file, and left out
};

// What a scan calls, in file order: a tick's command, the tick, its keyframe. Empty functions are skipped.
struct RunVisitor {
  std::function<void(const RecordedTick&)> tick;
  std::function<void(const RecordedCommand&)> command;
  std::function<void(const RecordedKeyframe&)> keyframe;
  std::function<void(const Loss&)> loss;
  std::function<void(const RecordedPolicyInput&)> policy_input = {};
  std::function<void(const ShownImage&)> image = {};
  std::function<void(const OtherTickLayout&)> other_tick_layout = {};  // once, before the first tick
};

struct ScanReport {
  McapReport file;
  std::uint64_t undecodable = 0;  // messages of a known topic that are not what they should be
  // The ticks were laid out otherwise than this version lays them out: what the run lacks is zero, and no checksum of a
  // tick could be compared.
  bool is_of_other_layout = false;
};
// Each message is read by its own description in the file. The error also says by which version it was made.
std::expected<ScanReport, std::string> scan_run(const RecordedRun& run, const RunVisitor& visitor);

}  // namespace takt::monitor
