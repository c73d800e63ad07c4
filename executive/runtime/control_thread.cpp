// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/control_thread.hpp"

#include <csignal>
#include <system_error>
#include <utility>

#include "executive/trace/trace.hpp"

namespace takt::runtime {
namespace {

// With memory locked, all of a thread's stack is resident: enough for the tick, not the default 8 MiB.
constexpr std::size_t kControlStackBytes = std::size_t{1} << 20U;

}  // namespace

struct ControlThread::Shared {
  const config::Control& control;
  CyclicLoop& loop;
  pthread_t thread{};
  std::promise<std::expected<std::vector<SetupStep>, std::string>> prepared{};
  std::promise<bool> may_run{};
  std::promise<void> ended{};
  std::future<void> end = ended.get_future();
  bool decided = false;
};

std::expected<ControlThread, std::string> ControlThread::start(const config::Control& control, CyclicLoop& loop) {
  ControlThread thread(std::unique_ptr<Shared>(new Shared{control, loop}));
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, kControlStackBytes);
  auto prepared = thread.shared_->prepared.get_future();
  const int error = pthread_create(&thread.shared_->thread, &attributes, main, thread.shared_.get());
  pthread_attr_destroy(&attributes);
  if (error != 0) {
    thread.shared_.reset();
    return std::unexpected("control thread: " + std::generic_category().message(error) +
                           ": free memory, or raise the limit on locked memory and threads");
  }
  auto steps = prepared.get();
  if (!steps) return std::unexpected(steps.error());
  thread.steps_ = std::move(*steps);
  return thread;
}

ControlThread::ControlThread(std::unique_ptr<Shared> shared) : shared_(std::move(shared)) {}

void* ControlThread::main(void* argument) {
  auto& shared = *static_cast<Shared*>(argument);
  pthread_setname_np(pthread_self(), "takt-control");
  sigset_t every_signal;
  sigfillset(&every_signal);
  pthread_sigmask(SIG_BLOCK, &every_signal, nullptr);
  const auto evidence = EvidenceSource::open();
  if (evidence) {
    trace::prepare_thread();
    shared.prepared.set_value(prepare_thread(shared.control));
    if (shared.may_run.get_future().get()) shared.loop.run(*evidence);
  } else {
    shared.prepared.set_value(std::unexpected(evidence.error()));
  }
  shared.ended.set_value();
  return nullptr;
}

void ControlThread::go() {
  if (!std::exchange(shared_->decided, true)) shared_->may_run.set_value(true);
}

bool ControlThread::finish(std::chrono::milliseconds limit) {
  shared_->loop.finish();
  if (!std::exchange(shared_->decided, true)) shared_->may_run.set_value(false);
  return shared_->end.wait_for(limit) == std::future_status::ready;
}

ControlThread::~ControlThread() {
  if (!shared_) return;
  shared_->loop.finish();
  if (!shared_->decided) shared_->may_run.set_value(false);
  pthread_join(shared_->thread, nullptr);
}

}  // namespace takt::runtime
