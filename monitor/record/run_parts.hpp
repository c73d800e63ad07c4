// SPDX-License-Identifier: Apache-2.0
// The record of one session, in parts: when a run folder's largest file has grown to a limit, or the part has lasted
// for an hour, the next keyframe ends it, and a folder of its own begins, with the same keyframe. Nothing is lost in
// between, and each part reads, reports, replays and is sealed by itself; their manifests name one another. So nothing
// that grows while a robot runs has a limit at which it would have to stop, no index or seal in memory grows for ever,
// and old parts can be deleted while new ones are written.
//
// Where no next folder can be made, the one that is there takes more. A thread of its own says a part's last words.
// Thread rule: one thread. Errors of start() are one sentence.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <expected>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "monitor/record/recorder.hpp"
#include "monitor/record/standby_thinner.hpp"

namespace takt::monitor {

inline constexpr std::uint64_t kDefaultPartBytes = std::uint64_t{1} << 30U;
inline constexpr Duration kLongestPart = seconds(3600);

class RunParts {
 public:
  // What is still to be recorded of a part that ends; run by a thread of its own.
  using LastWords = std::function<void(const RecordSink&)>;
  // A part begins in `next`, in the middle of the session.
  using OnSeam = std::function<LastWords(const RunFolder& next, const RunManifest& manifest)>;

  static std::expected<std::unique_ptr<RunParts>, std::string> start(const RunFolder& folder, RunManifest manifest,
                                                                     const config::RobotConfig& robot,
                                                                     std::uint64_t part_bytes,
                                                                     Duration longest_part = kLongestPart);
  RunParts(const RunParts&) = delete;
  RunParts& operator=(const RunParts&) = delete;
  ~RunParts();  // waits for what is being closed
  void on_seam(OnSeam told) { on_seam_ = std::move(told); }

  // As Recorder has them, of the part that is written.
  [[nodiscard]] const RecordSink& sink() const { return sink_; }
  void flush_if_due(MonoTime now);
  void drive_cards(std::string_view text) { current_->drive_cards(text); }
  std::expected<void, std::string> finish(MonoTime now, const std::string& because);
  [[nodiscard]] const std::string& stop_reason() const { return current_->stop_reason(); }
  [[nodiscard]] std::uint64_t written_through() const;
  [[nodiscard]] const RunManifest& manifest() const { return current_->manifest(); }
  // The robot stands by, and what a policy is shown now is most likely left out.
  [[nodiscard]] bool stands_by() const { return thinner_.holds_back(); }
  [[nodiscard]] const RunFolder& folder() const { return folder_; }

  // Folders of the parts that were closed since the last call, but the last one.
  std::vector<std::string> take_closed();
  // Why the newest attempt at a next part failed; empty: none did.
  [[nodiscard]] const std::string& failure() const { return failure_; }

 private:
  struct Ending {
    std::unique_ptr<Recorder> recorder;
    std::string folder;
    LastWords last_words;
  };
  RunParts(RunFolder folder, std::unique_ptr<Recorder> first, std::uint64_t part_bytes, Duration longest_part);
  [[nodiscard]] bool is_due(const RecordedKeyframe& keyframe) const;
  void keyframe(const RecordedKeyframe& keyframe);
  void policy_input(const RecordedPolicyInput& input);
  void begin_next(const RecordedKeyframe& keyframe);
  void close_ending();
  void wait_for_closer();

  const std::string base_;
  RunFolder folder_;
  const std::uint64_t part_bytes_;
  const Duration longest_part_;
  std::uint64_t next_at_bytes_;
  MonoTime next_at_;
  int number_ = 1;
  std::unique_ptr<Recorder> current_;
  RecordSink into_parts_;  // what the thinner keeps
  StandbyThinner thinner_;
  RecordSink sink_;
  OnSeam on_seam_;
  std::deque<RecordedPolicyInput> newest_inputs_;
  std::uint64_t through_before_ = 0;  // what the parts before have brought to the medium
  std::string failure_;

  std::unique_ptr<Ending> ending_;  // takes what a policy's host still says of the answers in it
  int drains_since_seam_ = 0;
  std::mutex closed_mutex_;
  std::vector<std::string> closed_;
  std::string
      seal_of_closed_;   // SHA-256 of the seal of the newest part that was closed; the closer's, until it is joined
  std::jthread closer_;  // last: ends first
};

}  // namespace takt::monitor
