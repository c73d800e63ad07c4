// SPDX-License-Identifier: Apache-2.0
// Several networks of one policy, each in a thread of its own, for several requests in flight
// (policy.requests_in_flight).
//
// A worker has at most one request at a time and answers nothing but infer(): what goes in and comes out is the
// caller's affair. Requests and policies outlive the pool. An exception that leaves an engine ends the process, as it
// does without a pool. Ends within what an inference takes. Thread rule: one caller.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include "executive/contract/mono_time.hpp"
#include "policy_host/policy.hpp"
#include "policy_host/responder.hpp"

namespace takt::policy_host {

class InferencePool {
 public:
  InferencePool(std::span<Policy* const> policies, Clock clock);
  InferencePool(const InferencePool&) = delete;
  InferencePool& operator=(const InferencePool&) = delete;
  ~InferencePool();

  // A worker that has nothing to do; empty: none.
  [[nodiscard]] std::optional<std::size_t> idle() const;
  // Precondition: the worker is idle. The request is the worker's until it is finished.
  void start(std::size_t worker, Request& request);
  // The worker whose inference ended first, which is idle again; sleeps for it, no longer than `until`; empty: none.
  std::optional<std::size_t> finished(MonoTime until);

 private:
  struct Worker {
    Request* request = nullptr;  // in its hands; null: none
    bool busy = false;           // until the caller has it back
  };
  void work(Policy& policy, std::size_t worker);

  Clock clock_;
  mutable std::mutex mutex_;
  std::condition_variable work_, done_;
  std::vector<Worker> workers_;
  std::vector<std::size_t> ended_;  // in the order of their ends
  bool over_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace takt::policy_host
