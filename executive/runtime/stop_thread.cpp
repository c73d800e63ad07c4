// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/stop_thread.hpp"

#include <pthread.h>

#include <csignal>
#include <system_error>
#include <utility>

#include "executive/runtime/clock.hpp"

namespace takt::runtime {
namespace {

constexpr std::size_t kStopStackBytes = std::size_t{256} << 10U;  // resident where memory is locked

}  // namespace

void pass_on(OperatorVerb verb, MonoTime now, OperatorInbox& requests) noexcept {
  switch (verb) {
    case OperatorVerb::stop:
      return requests.stop(now);
    case OperatorVerb::press_stop:
      return requests.press_stop(now);
    case OperatorVerb::deenergise:
      return requests.deenergise(now);
    case OperatorVerb::status:
    case OperatorVerb::arm:
    case OperatorVerb::reset:
    case OperatorVerb::mark:
    case OperatorVerb::swap:
    case OperatorVerb::back:
      return;
  }
}

std::expected<std::unique_ptr<StopThread>, std::string> StopThread::start(const std::string& path,
                                                                          OperatorInbox& requests) {
  auto line = ipc::StopLine::listen(path);
  if (!line) return std::unexpected(line.error());
  std::unique_ptr<StopThread> thread(new StopThread(std::move(*line), requests));
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, kStopStackBytes);
  const int error = pthread_create(&thread->thread_, &attributes, main, thread.get());
  pthread_attr_destroy(&attributes);
  if (error != 0)
    return std::unexpected("stop thread: " + std::generic_category().message(error) +
                           ": free memory, or raise the limit on locked memory and threads");
  thread->runs_ = true;
  return thread;
}

StopThread::StopThread(ipc::StopLine line, OperatorInbox& requests) : line_(std::move(line)), requests_(requests) {}

StopThread::~StopThread() {
  line_.close();
  if (runs_) pthread_join(thread_, nullptr);
}

void* StopThread::main(void* self) {
  auto& watch = *static_cast<StopThread*>(self);
  pthread_setname_np(pthread_self(), "takt-stop");
  sigset_t every_signal;
  sigfillset(&every_signal);
  pthread_sigmask(SIG_BLOCK, &every_signal, nullptr);
  SystemClock clock;
  while (const auto verb = watch.line_.wait()) pass_on(*verb, clock.now(), watch.requests_);
  return nullptr;
}

}  // namespace takt::runtime
