// SPDX-License-Identifier: Apache-2.0
// The thread that hears a stop (ipc/stop_line.hpp) and sets its flag for the next tick. It does nothing else: no log,
// no allocation, no lock, no wait; so a stop is served whatever the service thread, the log, the monitor,
// the policy or the disk are doing.
//
// Thread rules: start() and the destructor belong to the service thread.
#pragma once

#include <pthread.h>

#include <expected>
#include <memory>
#include <string>

#include "executive/ipc/stop_line.hpp"
#include "executive/runtime/operator_inbox.hpp"

namespace takt::runtime {

class StopThread {
 public:
  // `requests` outlives it. Precondition: that of StopLine::listen. The error: socket or thread are not to be had.
  static std::expected<std::unique_ptr<StopThread>, std::string> start(const std::string& path,
                                                                       OperatorInbox& requests);
  StopThread(const StopThread&) = delete;
  StopThread& operator=(const StopThread&) = delete;
  ~StopThread();

 private:
  StopThread(ipc::StopLine line, OperatorInbox& requests);
  static void* main(void* self);

  ipc::StopLine line_;
  OperatorInbox& requests_;
  pthread_t thread_{};
  bool runs_ = false;
};

// What a stop's verb asks of the control thread; nothing for any other verb.
void pass_on(OperatorVerb verb, MonoTime now, OperatorInbox& requests) noexcept;

}  // namespace takt::runtime
