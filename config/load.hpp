// SPDX-License-Identifier: Apache-2.0
// Loads a robot file. Strict: unknown or duplicate keys, missing units, YAML octals and booleans-by-accident, reversed
// ranges and count mismatches are refused with one line "file:line:column: what; how to correct it".
#pragma once

#include <expected>
#include <span>
#include <string>
#include <string_view>

#include "config/robot_config.hpp"

namespace takt::config {

// Exit code of every Takt program for a refused configuration.
inline constexpr int kExitBadConfiguration = 65;

// All problems found, one per line, in file order.
std::expected<RobotConfig, std::string> load(const std::string& path);
std::expected<RobotConfig, std::string> parse(std::string_view text, const std::string& name_for_messages);
// Of a run folder's config.yaml, which an earlier version may have written: its keys that are gone are left out.
std::expected<RobotConfig, std::string> parse_recorded(std::string_view text, const std::string& name_for_messages);

// The robot's canonical text (RobotConfig::resolved) with every default written out: the same robot, and the same hash.
std::string with_every_default(const RobotConfig& robot);

// One key of a robot file said otherwise: its dotted path ("freshness.max_age") and its value, as one would write it.
struct Override {
  std::string key, value;
};
// The same robot with these values instead of its own, judged as a whole again; defaults may be overridden too, entries
// of lists may not; `{}` leaves nothing of a section. The error: one problem per line, by dotted path.
std::expected<RobotConfig, std::string> with_overrides(const RobotConfig& robot, std::span<const Override> overrides);

// Stable over processes: FNV-1a over the joint names in order.
std::uint64_t joint_names_hash(const RobotConfig& robot);
// First 8 bytes of the file's SHA-256, big-endian; the sentence says why it could not be read.
std::expected<std::uint64_t, std::string> policy_hash(const std::string& path);
std::string sha256_hex(std::string_view bytes);

}  // namespace takt::config
