// SPDX-License-Identifier: Apache-2.0
// Writes one run folder: ticks.mcap, transitions.jsonl, can.log.zst, config.yaml, drives.json, manifest.json and the
// seal of them all (run_seal.hpp).
//
// flush_if_due() hands the first ticks at once, then everything older than half a second to the medium, so that a power
// cut loses at most the last second. When a file takes no more data (disk full, size limit) or its medium refuses what
// it took, recording stops: room kept in reserve is freed for the words that declare it, stop_reason() says why, and
// the recorder goes on counting what it no longer writes. Thread rule: one thread. Errors of start() are one sentence.
#pragma once

#include <cstdint>
#include <expected>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "config/robot_config.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/diagnostics.hpp"
#include "monitor/record/mcap_writer.hpp"
#include "monitor/record/record_stream.hpp"
#include "monitor/record/run_folder.hpp"

namespace takt::monitor {

inline constexpr std::uint64_t kNoLimit = ~std::uint64_t{0};

class Recorder {
 public:
  // `manifest` says what is known at the start; the recorder keeps it up to date and writes it. `max_file_bytes`: of
  // each file, as if the disk were full then.
  static std::expected<std::unique_ptr<Recorder>, std::string> start(const RunFolder& folder, RunManifest manifest,
                                                                     const config::RobotConfig& robot,
                                                                     std::uint64_t max_file_bytes = kNoLimit);
  // Records into `folder` what follows, as another part of the session, with all that this one knows; brings what this
  // one has to the medium, which then awaits its last words only. The error: this one goes on.
  std::expected<std::unique_ptr<Recorder>, std::string> begin_next(const RunFolder& folder);

  // What a RecordStream hands on goes in here. Valid as long as the recorder.
  [[nodiscard]] const RecordSink& sink() const { return sink_; }
  void flush_if_due(MonoTime now);
  // The executive's drives.json, whenever it says something new: kept in the folder, and quoted by the manifest. What
  // is no such file of this robot is left alone.
  void drive_cards(std::string_view text);
  // Of the part before, once that is closed.
  void goes_on_from(std::string seal_sha256) { manifest_.goes_on_from_seal = std::move(seal_sha256); }
  // Last words. Afterwards nothing may be recorded.
  std::expected<void, std::string> finish(MonoTime now, const std::string& because);

  [[nodiscard]] const std::string& stop_reason() const { return manifest_.stopped_because; }  // empty: recording
  // Of the largest file.
  [[nodiscard]] std::uint64_t size() const;
  // Newest tick that the medium has, or that stood by and was left out; 0: none yet, or recording stopped.
  [[nodiscard]] std::uint64_t written_through() const { return stop_reason().empty() ? flushed_through_ : 0; }
  [[nodiscard]] MonoTime now() const { return now_; }  // of the newest tick that it was given
  // Newest tick that it was given, or told to be left out.
  [[nodiscard]] std::uint64_t newest_tick() const { return newest_tick_; }
  [[nodiscard]] const RunManifest& manifest() const { return manifest_; }

 private:
  // What is known of the robot from its ticks, whatever part they went into.
  struct Watch {
    explicit Watch(const config::RobotConfig& watched) : robot(watched), diagnoser(robot) {}
    config::RobotConfig robot;
    Diagnoser diagnoser;
    std::string cards;  // drives.json
  };
  static std::expected<std::unique_ptr<Recorder>, std::string> make(const RunFolder& folder, RunManifest manifest,
                                                                    std::shared_ptr<Watch> watch,
                                                                    std::uint64_t max_file_bytes);
  Recorder(const RunFolder& folder, RunManifest manifest, std::shared_ptr<Watch> watch, McapWriter ticks,
           BoundedFile frames, BoundedFile transitions);
  void tick(const TickRecord& record);
  void transition(const TickRecord& record);
  void log(Level level, std::string_view text);
  void frame(const FrameRecord& frame);
  void loss(const Loss& loss);
  void write(Topic topic, MonoTime at) { write(static_cast<std::uint16_t>(topic), at); }
  void write(std::uint16_t channel, MonoTime at);
  void picture(const ShownPicture& picture);
  [[nodiscard]] std::int64_t unix_ns(MonoTime at) const { return at.ns + manifest_.clock.monotonic_to_unix_ns; }
  void write_frames();
  void flush_ticks();
  void flush();
  void close_segments();
  std::expected<void, std::string> write_seal(bool closed);
  void stop(std::string because);  // by value: it may be the text of the failure that gets cleared

  RunFolder folder_;
  std::shared_ptr<Watch> watch_;
  RunManifest manifest_;
  McapWriter ticks_;
  BoundedFile frames_;
  BoundedFile transitions_;
  RecordSink sink_;
  CdrWriter message_;
  std::string frame_text_;  // lines not yet in can.log.zst
  MonoTime now_;            // of the newest tick: log time of what has none of its own
  MonoTime flushed_at_;
  MonoTime segment_began_, sealed_at_;
  std::uint64_t joint_state_every_, transforms_every_;  // ticks
  std::uint64_t newest_tick_ = 0;
  std::uint64_t flushed_ticks_ = 0, flushed_tick_ = 0, flushed_through_ = 0;  // what is on the medium
};

}  // namespace takt::monitor
