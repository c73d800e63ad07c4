// SPDX-License-Identifier: Apache-2.0
// manifest.json of a run folder: what ran, on what, from when to when, and what is missing. Written when recording
// starts (complete: false) and again when it ends; docs/run-folder.md lists the fields.
#pragma once

#include <cstdint>
#include <expected>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"
#include "monitor/record/run_messages.hpp"

namespace takt::monitor {

inline constexpr const char* kRunSchema = "takt.run/2";
// Also read: its config.yaml has every default written out.
inline constexpr const char* kFirstRunSchema = "takt.run/1";
inline constexpr const char* kDrivesSchema = "takt.drives/1";

struct ClockOffset {
  std::int64_t monotonic_to_unix_ns = 0;  // unix = monotonic + this; fixed for the whole run
  std::string source;                     // "executive.json" or "monitor"
};

struct RunManifest {
  std::string run_id;
  std::string robot;
  std::vector<std::string> joints;
  std::vector<std::string> buses;                        // interface names, as in can.log.zst
  std::vector<std::string> cautions;                     // what config check notes of the robot file
  std::vector<config::WatchdogWaiver> watchdog_waivers;  // drives that nothing is known to stop when commands cease
  std::string config_sha256;
  std::string policy_file;    // empty: the robot has no policy
  std::string policy_sha256;  // 64 hex digits
  std::int64_t executive_pid = 0;
  std::string executive_sha256;      // of its binary, by executive.json; empty: unknown
  nlohmann::ordered_json executive;  // executive.json as found; null when absent
  nlohmann::ordered_json host;       // host_facts()
  nlohmann::ordered_json doctor;     // what `takt doctor --keep` said of this machine; null: nothing was kept
  nlohmann::ordered_json drives;     // drives.json: what the drives said of themselves; null: it was not kept
  ClockOffset clock;
  MonoTime started_at, ended_at;  // ended_at unset while recording
  std::string ended_because;
  std::string goes_on_from, goes_on_in;  // the parts before and behind this one of a long session: their run ids
  std::string goes_on_from_seal;         // SHA-256 of the seal.json of the part before; empty while this one is written
  bool complete = false;                 // closed in order, and recording never had to stop
  std::string stopped_because;           // non-empty: recording stopped before the run did
  std::uint64_t ticks = 0, first_tick = 0, last_tick = 0;
  std::uint64_t stood_by_ticks = 0;             // left out between first and last: one in kOneIn of standby is kept
  std::uint64_t unrecorded_ticks = 0;           // seen after recording stopped
  std::map<std::string, std::uint64_t> losses;  // "tick overwritten" -> entries
  std::vector<Loss> first_losses;               // at most kListedLosses
};
inline constexpr std::size_t kListedLosses = 100;

nlohmann::ordered_json to_json(const RunManifest& manifest);
// "made by takt 0.1.0; this is takt 0.2.0+git900.0123456789ab": for what cannot be read.
std::string whose(const nlohmann::ordered_json& executive);
// One sentence when a field is missing or of another type.
std::expected<RunManifest, std::string> manifest_of(const nlohmann::ordered_json& json);

// Kernel, processor, memory, and whether the kernel is PREEMPT_RT.
nlohmann::ordered_json host_facts();
// "2026-11-21T09:33:00.123Z"
std::string utc_text(std::int64_t unix_ns);

}  // namespace takt::monitor
