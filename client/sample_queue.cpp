// SPDX-License-Identifier: Apache-2.0
#include "client/sample_queue.hpp"

#include <algorithm>
#include <span>

#include "executive/contract/joints.hpp"
#include "executive/contract/monotonic_clock.hpp"

namespace takt::client {
namespace {

// The age of an older sample is its own affair: it stands for the past.
bool may_be_shown(SampleVerdict verdict) {
  return verdict == SampleVerdict::usable || verdict == SampleVerdict::too_old;
}

}  // namespace

SampleQueue::SampleQueue(const config::Sensor& sensor)
    : sensor_(sensor),
      waiting_(sensor.queue),
      shown_(sensor.queue),
      values_(std::size_t{sensor.queue} * sensor.values),
      sensed_(sensor.queue) {}

void SampleQueue::forget() {
  first_ = count_ = 0;
  dropped_ = 0;
}

void SampleQueue::put(const SensorSample& sample) {
  if (count_ == waiting_.size()) {
    first_ = (first_ + 1) % waiting_.size();
    --count_;
    ++dropped_;
  }
  waiting_[(first_ + count_) % waiting_.size()] = sample;
  ++count_;
}

void SampleQueue::take_all(policy_host::SensorLink& link, MonoTime now, bool lockstep, SensorSample& newest) {
  link.stay_attached(now);
  // What a sensor said before we listened was not lost.
  const bool is_new = link.sessions() != session_;
  session_ = link.sessions();
  constexpr std::size_t kMost = 4 * kMaxSensorQueue;  // twice the mailbox: the writer may go on meanwhile
  for (std::size_t i = 0; i < kMost; ++i) {
    SensorSample sample;
    const ipc::ReadResult result = link.next(std::as_writable_bytes(std::span(&sample, 1)));
    if (result.status == ipc::ReadStatus::nothing_new || result.status == ipc::ReadStatus::contended) break;
    dropped_ += result.lost;
    if (result.status != ipc::ReadStatus::fresh) {
      ++dropped_;
      continue;
    }
    newest = sample;
    if (may_be_shown(policy_host::judge(sensor_, sample, lockstep ? sample.published_at : monotonic_now())))
      put(sample);
    else
      ++dropped_;
  }
  if (is_new) dropped_ = 0;
}

void SampleQueue::show(takt_queue& view) {
  shown_count_ = count_;
  for (std::size_t i = 0; i < count_; ++i) {
    const SensorSample& sample = shown_[i] = waiting_[(first_ + i) % waiting_.size()];
    std::copy_n(sample.values, sensor_.values, &values_[i * sensor_.values]);
    sensed_[i] = sample.sensed_at.ns;
  }
  view = {.values = values_.data(),
          .sensed_ns = sensed_.data(),
          .count = static_cast<std::uint32_t>(count_),
          .capacity = sensor_.queue,
          .value_count = sensor_.values,
          .reserved = 0,
          .dropped = dropped_};
  forget();
}

}  // namespace takt::client
