// SPDX-License-Identifier: Apache-2.0
#include "policy_host/inference_pool.hpp"

#include <algorithm>
#include <chrono>

namespace takt::policy_host {

InferencePool::InferencePool(std::span<Policy* const> policies, Clock clock)
    : clock_(clock), workers_(policies.size()) {
  for (std::size_t worker = 0; worker < policies.size(); ++worker)
    threads_.emplace_back([this, policy = policies[worker], worker] { work(*policy, worker); });
}

InferencePool::~InferencePool() {
  {
    const std::scoped_lock lock(mutex_);
    over_ = true;
  }
  work_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

std::optional<std::size_t> InferencePool::idle() const {
  const std::scoped_lock lock(mutex_);
  const auto found = std::ranges::find(workers_, false, &Worker::busy);
  if (found == workers_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - workers_.begin());
}

void InferencePool::start(std::size_t worker, Request& request) {
  {
    const std::scoped_lock lock(mutex_);
    workers_[worker] = {&request, true};
  }
  work_.notify_all();
}

std::optional<std::size_t> InferencePool::finished(MonoTime until) {
  std::unique_lock lock(mutex_);
  const std::chrono::steady_clock::time_point when{std::chrono::nanoseconds(until.ns)};  // CLOCK_MONOTONIC
  if (!done_.wait_until(lock, when, [this] { return !ended_.empty(); })) return std::nullopt;
  const std::size_t worker = ended_.front();
  ended_.erase(ended_.begin());
  workers_[worker].busy = false;
  return worker;
}

void InferencePool::work(Policy& policy, std::size_t worker) {
  std::unique_lock lock(mutex_);
  while (true) {
    work_.wait(lock, [&] { return over_ || workers_[worker].request != nullptr; });
    if (over_) return;
    Request* const request = workers_[worker].request;
    lock.unlock();
    Responder::infer(policy, *request, clock_);
    lock.lock();
    workers_[worker].request = nullptr;
    ended_.push_back(worker);
    done_.notify_one();
  }
}

}  // namespace takt::policy_host
