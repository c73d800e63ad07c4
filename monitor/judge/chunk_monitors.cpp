// SPDX-License-Identifier: Apache-2.0
#include "monitor/judge/chunk_monitors.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <utility>

namespace takt::monitor {
namespace {

constexpr std::size_t kRemembered = 1024;  // observations: more than any max_age holds at usual rates

bool is_followed(Mode mode) {
  return mode == Mode::tracking || mode == Mode::degraded;
}

}  // namespace

ChunkMonitors::ChunkMonitors(const config::RobotConfig& robot) : joints_(robot.joints.size()) {
  if (!robot.policy) return;
  scorer_.emplace(robot);
  if (!robot.policy->monitors) return;
  rule_ = *robot.policy->monitors;
  for (const config::ChunkThreshold& one : rule_.thresholds)
    thresholds_[static_cast<std::size_t>(one.score)] = one.above;
}

void ChunkMonitors::command(const CommandChunk& chunk) {
  read_bytes_ = std::min(chunk.used_bytes(), sizeof chunk);
  std::memcpy(read_.get(), &chunk, read_bytes_);
}

void ChunkMonitors::command(const RecordedCommand& command) {
  if (command.sender != Player::policy) return;
  read_bytes_ = std::min(command.payload.size(), sizeof *read_);
  std::memcpy(read_.get(), command.payload.data(), read_bytes_);
}

// A recording may be damaged, and cut what was refused.
bool ChunkMonitors::is_whole() const {
  const CommandHeader& header = read_->header;
  return read_bytes_ > sizeof header && header.joint_count == joints_ && header.step_count > 0 &&
         header.step_count <= kMaxChunkSteps && header.step_period > Duration{} && read_bytes_ == read_->used_bytes();
}

void ChunkMonitors::forget() {
  scorer_->forget();
  newest_.clear();
  caught_ = {};
}

void ChunkMonitors::tick(const TickRecordHeader& header) {
  const bool has_read = is_whole();
  read_bytes_ = 0;
  if (!scorer_) return;
  if (!is_followed(header.mode) || header.seats[Seat::policy].session != session_) forget();
  session_ = header.seats[Seat::policy].session;
  if (has_read && header.seats[Seat::policy].arrival == Arrival::accepted && is_followed(header.mode)) {
    const auto answered = std::ranges::find(published_, read_->header.observation_id, &Published::observation);
    if (answered != published_.end()) watch(header, scorer_->score(*read_, answered->at));
  }
  if (header.observation_published == 0) return;
  published_.push_back({header.observation_published, header.now});
  if (published_.size() > kRemembered) published_.pop_front();
}

void ChunkMonitors::watch(const TickRecordHeader& header, const ChunkScores& scores) {
  ++answers_;
  newest_.push_back(scores);
  if (newest_.size() > static_cast<std::size_t>(rule_.of)) newest_.pop_front();
  for (std::size_t score = 0; score < config::kChunkScoreCount; ++score)
    judge(header, static_cast<config::ChunkScore>(score));
}

void ChunkMonitors::judge(const TickRecordHeader& header, config::ChunkScore score) {
  const auto index = static_cast<std::size_t>(score);
  const auto votes = static_cast<std::size_t>(rule_.votes);
  if (newest_.size() < votes) return;
  std::vector<double> values;
  for (const ChunkScores& one : newest_) values.push_back(one[index]);
  std::ranges::nth_element(values, values.begin() + static_cast<std::ptrdiff_t>(votes - 1), std::greater{});
  const double reached = values[votes - 1];
  levels_[index] = std::max(levels_[index], reached);
  if (!thresholds_[index]) return;
  const bool catches = reached > *thresholds_[index];
  if (catches && !std::exchange(caught_[index], true)) {
    ++catch_count_;
    if (catches_.size() < kListedCatches)
      catches_.push_back(
          {.score = score,
           .tick = header.tick,
           .at = header.now,
           .command = read_->header.sequence,
           .observation = read_->header.observation_id,
           .value = reached,
           .threshold = *thresholds_[index],
           .sentence = fmt::format(
               "{} {:.3g} or more in {} of {} answers, above {:.3g}; the last one answers observation {}", name(score),
               reached, votes, newest_.size(), *thresholds_[index], read_->header.observation_id)});
  }
  caught_[index] = catches;
}

}  // namespace takt::monitor
