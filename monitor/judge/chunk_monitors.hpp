// SPDX-License-Identifier: Apache-2.0
// Watches the policy's accepted answers while the robot follows it (tracking or degraded), by their numbers alone
// (chunk_scores.hpp). A catch begins where at least `votes` of the newest `of` answers have a score above its threshold
// (policy.monitors), and ends when fewer have. It decides nothing: it says which answers, and why.
//
// Level of a score: the largest value that `votes` of `of` neighbouring answers reached together. A threshold below it
// would have caught, one at or above it not.
//
// Reads ticks in order, each command before the tick that read it. Thread rule: one thread at a time.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/tick_record.hpp"
#include "monitor/judge/chunk_scores.hpp"
#include "monitor/record/run_messages.hpp"

namespace takt::monitor {

struct PolicyCatch {
  config::ChunkScore score = config::ChunkScore::temporal_error;
  std::uint64_t tick = 0;  // that accepted the last of the answers
  MonoTime at;
  std::uint64_t command = 0, observation = 0;  // of that answer: its sequence, and what it answers
  double value = 0, threshold = 0;             // what `votes` of the answers reached together
  std::string
      sentence;  // "temporal_error 0.42 or more in 20 of 40 answers, above 0.31; the last one answers observation 812"
};
inline constexpr std::size_t kListedCatches = 1000;

class ChunkMonitors {
 public:
  // A robot without a policy has nothing to watch.
  explicit ChunkMonitors(const config::RobotConfig& robot);

  void command(const CommandChunk& chunk);
  void command(const RecordedCommand& command);  // the fallback policy's are left out
  void tick(const TickRecordHeader& header);

  [[nodiscard]] const config::ChunkMonitors& rule() const {
    return rule_;
  }  // the default one where the robot file has none
  [[nodiscard]] const std::vector<PolicyCatch>& catches() const { return catches_; }  // the first kListedCatches
  [[nodiscard]] std::uint64_t catch_count() const { return catch_count_; }
  [[nodiscard]] const ChunkScores& levels() const { return levels_; }
  [[nodiscard]] std::uint64_t answers() const { return answers_; }  // watched
  void forget_levels() {
    levels_ = {};
    answers_ = 0;
  }

 private:
  [[nodiscard]] bool is_whole() const;
  void watch(const TickRecordHeader& header, const ChunkScores& scores);
  void judge(const TickRecordHeader& header, config::ChunkScore score);
  void forget();

  std::optional<ChunkScorer> scorer_;
  config::ChunkMonitors rule_;
  std::array<std::optional<double>, config::kChunkScoreCount> thresholds_;
  std::size_t joints_;
  std::unique_ptr<CommandChunk> read_ = std::make_unique<CommandChunk>();
  std::size_t read_bytes_ = 0;  // 0: nothing was read
  struct Published {
    std::uint64_t observation = 0;
    MonoTime at;
  };
  std::deque<Published> published_;
  std::deque<ChunkScores> newest_;
  std::array<bool, config::kChunkScoreCount> caught_{};
  ChunkScores levels_{};
  std::uint64_t answers_ = 0, catch_count_ = 0;
  std::vector<PolicyCatch> catches_;
  std::uint8_t session_ = 0;
};

}  // namespace takt::monitor
