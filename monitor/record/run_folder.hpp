// SPDX-License-Identifier: Apache-2.0
// A run's folder and the names inside it. One folder holds one session of an executive as one life of the monitor saw
// it; an existing folder is never written into again: a later session, or the next part of a long one, gets the name
// with ".2", ".3", ... behind it.
#pragma once

#include <expected>
#include <filesystem>
#include <string>

#include "monitor/record/run_manifest.hpp"

namespace takt::monitor {

class RunFolder {
 public:
  explicit RunFolder(std::string path) : path_(std::move(path)) {}
  // Makes `wanted`, parents included, or its first free successor; `from` > 1: its first free one from that number on.
  static std::expected<RunFolder, std::string> create(const std::string& wanted, int from = 1);

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::string name() const { return std::filesystem::path(path_).filename(); }  // a run's id
  [[nodiscard]] std::string manifest() const { return path_ + "/manifest.json"; }
  [[nodiscard]] std::string config() const { return path_ + "/config.yaml"; }
  [[nodiscard]] std::string drives() const { return path_ + "/drives.json"; }
  [[nodiscard]] std::string ticks() const { return path_ + "/ticks.mcap"; }
  [[nodiscard]] std::string images() const { return path_ + "/images"; }
  [[nodiscard]] std::string frames() const { return path_ + "/can.log.zst"; }
  [[nodiscard]] std::string transitions() const { return path_ + "/transitions.jsonl"; }
  [[nodiscard]] std::string metrics() const { return path_ + "/metrics.json"; }
  [[nodiscard]] std::string report() const { return path_ + "/report.html"; }
  [[nodiscard]] std::string seal() const { return path_ + "/seal.json"; }
  [[nodiscard]] std::string reserve() const { return path_ + "/.reserve"; }

  [[nodiscard]] std::expected<RunManifest, std::string> read_manifest() const;
  std::expected<void, std::string> write_manifest(const RunManifest& manifest) const;

 private:
  std::string path_;
};

// "20261121T093300Z-arm6-3f9a2c": sorts by time, and two runs of one second differ.
std::string new_run_id(const std::string& robot, std::int64_t unix_ns);

}  // namespace takt::monitor
