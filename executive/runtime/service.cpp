// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/service.hpp"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <csignal>
#include <cstring>

#include "executive/runtime/clock.hpp"
#include "executive/runtime/journal.hpp"
#include "executive/runtime/service_manager.hpp"
#include "executive/runtime/shutdown.hpp"

namespace takt::runtime {
namespace {

constexpr std::chrono::milliseconds kServeFor{10};

sigset_t shutdown_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&signals, signal);
  return signals;
}

// 0: none pending.
int take_signal() {
  const sigset_t signals = shutdown_signals();
  const timespec no_wait{};
  const int signal = sigtimedwait(&signals, nullptr, &no_wait);
  return signal > 0 ? signal : 0;
}

// Says once when ticks stop advancing, and once when they advance again.
class StandstillAlarm {
 public:
  void watch(MonoTime now, std::uint64_t ticks) {
    if (ticks != ticks_ || !advanced_at_.is_set()) {
      if (alarmed_) spdlog::warn("the control thread ticks again");
      alarmed_ = false;
      ticks_ = ticks;
      advanced_at_ = now;
    } else if (!alarmed_ && now - advanced_at_ > seconds(1)) {
      alarmed_ = true;
      spdlog::error("the control thread has not completed a tick for 1 s");
    }
  }

 private:
  std::uint64_t ticks_ = 0;
  MonoTime advanced_at_;
  bool alarmed_ = false;
};

// Says once that no operator can connect any more. Looks once a second.
class NameAlarm {
 public:
  void watch(MonoTime now, const Reception& reception) {
    if (alarmed_ || (looked_at_.is_set() && now - looked_at_ < seconds(1))) return;
    looked_at_ = now;
    if (reception.has_name()) return;
    alarmed_ = true;
    spdlog::error(
        "the runtime directory, or the socket in it, was removed: `takt stop` cannot reach this robot; Ctrl+C in `takt "
        "run`, `systemctl stop`, or SIGTERM to process {} still stop it",
        getpid());
  }

 private:
  MonoTime looked_at_;
  bool alarmed_ = false;
};

}  // namespace

void block_shutdown_signals() {
  const sigset_t signals = shutdown_signals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
}

void serve(Reception& reception, TickFollower& follower, DriveCards& cards, StatusBoard& board, OperatorInbox& requests,
           TransmitQueues& queues, trace::Introduction& introduction, ImuLink* imu) {
  SystemClock clock;
  Journal journal;
  ServiceManager manager;
  StandstillAlarm alarm;
  NameAlarm name_alarm;
  Shutdown shutdown;
  std::uint64_t asked_at_tick = 0;
  while (true) {
    reception.serve(kServeFor);
    follower.catch_up();
    cards.catch_up();
    const MonoTime now = clock.now();
    queues.serve(now);
    introduction.when_traced(now);
    if (imu != nullptr) imu->serve(now);
    const StatusSnapshot& status = board.read();
    journal.summarise(now, status);
    alarm.watch(now, status.ticks);
    name_alarm.watch(now, reception);
    if (manager.report(now, status.ticks, status_line(status))) spdlog::info("ready: {} ticks", status.ticks);
    if (const int signal = take_signal(); signal != 0) {
      spdlog::info("SIG{}: {}", sigabbrev_np(signal),
                   shutdown.is_requested() ? "ending now" : "damped stop, then exit");
      if (!shutdown.is_requested()) asked_at_tick = follower.latest().header.tick;
      shutdown.signal(now);
      requests.shut_down(now);
      reception.begin_shutdown();
      manager.stopping();
    }
    const bool noticed = follower.noticed(OperatorRequest::shutdown, asked_at_tick);
    if (shutdown.may_end(now, noticed, follower.latest().header.mode, follower.rests())) return;
  }
}

}  // namespace takt::runtime
