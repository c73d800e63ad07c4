// SPDX-License-Identifier: Apache-2.0
// The thread the loop runs on: its own small locked stack, signals blocked, prepared before its first tick.
//
// start() returns once the thread has prepared itself; the caller looks at the results, then calls go(), or lets the
// object end without it: the thread then ends without a tick. The destructor finishes the loop and joins. Thread rule:
// the service thread owns it.
#pragma once

#include <pthread.h>

#include <chrono>
#include <expected>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/runtime/cyclic_loop.hpp"
#include "executive/runtime/realtime_setup.hpp"

namespace takt::runtime {

class ControlThread {
 public:
  // `loop` and `control` outlive it. The error: no thread to be had, or the kernel keeps no account of it.
  static std::expected<ControlThread, std::string> start(const config::Control& control, CyclicLoop& loop);
  ControlThread(ControlThread&&) noexcept = default;
  ControlThread& operator=(ControlThread&&) = delete;
  ~ControlThread();

  [[nodiscard]] const std::vector<SetupStep>& steps() const { return steps_; }
  void go();
  // Has the loop end, and waits at most `limit` for it. False: it hangs.
  bool finish(std::chrono::milliseconds limit);

 private:
  struct Shared;
  explicit ControlThread(std::unique_ptr<Shared> shared);
  static void* main(void* shared);

  std::unique_ptr<Shared> shared_;
  std::vector<SetupStep> steps_;
};

}  // namespace takt::runtime
