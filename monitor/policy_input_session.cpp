// SPDX-License-Identifier: Apache-2.0
#include "monitor/policy_input_session.hpp"

#include <chrono>
#include <utility>

#include "config/observation_shape.hpp"
#include "config/paths.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "monitor/executive_session.hpp"

namespace takt::monitor {
namespace {

constexpr std::chrono::milliseconds kAttachTimeout{100};
constexpr Duration kRetry = milliseconds(500);

constexpr std::int64_t kAnswersPerObservation = 2;  // one, and no clock makes a loss of an honest answer

// Of answers, as many as a policy of this robot can give.
TokenBucket bucket_of(const config::RobotConfig& robot, std::size_t largest_input) {
  const Duration period = robot.policy ? robot.policy->period : seconds(1);
  return {nanoseconds(period.ns / kAnswersPerObservation), ipc::policy_input_ring(largest_input).slot_count};
}

constexpr Role reader_of(Player policy) {
  if (policy == Player::candidate) return Role::candidate_input_reader;
  return policy == Player::fallback ? Role::fallback_input_reader : Role::input_reader;
}

}  // namespace

PolicyInputSession::PolicyInputSession(const std::string& runtime_directory, const config::RobotConfig& robot,
                                       Player of)
    : socket_(config::executive_socket(runtime_directory)),
      hello_(hello_of(reader_of(of), "takt-monitor", robot)),
      largest_input_(of == Player::fallback && config::fallback_policy_of(robot) == nullptr
                         ? 0
                         : config::largest_policy_input(robot)),
      of_(of),
      bucket_(bucket_of(robot, largest_input_)) {}

void PolicyInputSession::attach() {
  auto lease = ipc::attach(socket_, hello_, kAttachTimeout);
  if (!lease || lease->descriptors.empty()) return;  // it is about to end, or another version: the ticks' own link says
  auto segment = ipc::Segment::adopt_read_only(lease->descriptors[0].release(),
                                               ipc::ring_bytes(ipc::policy_input_ring(largest_input_)));
  if (!segment) return;
  PolicyInputStream stream(segment->readable(), largest_input_, of_);
  attached_.emplace(std::move(*lease), std::move(*segment), std::move(stream));
}

void PolicyInputSession::drain(MonoTime now, const RecordSink& sink) {
  if (largest_input_ == 0) return;
  if (attached_) {
    const bool is_over = ipc::is_over(attached_->lease);  // asked first: what it published before that is in the ring
    bucket_.refill(now);
    attached_->stream.drain(sink, bucket_);
    if (is_over) attached_.reset();
  }
  if (attached_ || now < next_attempt_) return;
  next_attempt_ = now + kRetry;
  attach();
}

}  // namespace takt::monitor
