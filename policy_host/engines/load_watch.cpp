// SPDX-License-Identifier: Apache-2.0
#include "policy_host/engines/load_watch.hpp"

#include <fmt/format.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <cstring>

#include "config/load.hpp"

namespace takt::policy_host {
namespace {

constexpr std::array kCrashes{SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT};
constexpr std::size_t kStackBytes = 64 * 1024;

// The sentences, written before anything can happen: a signal handler makes none.
struct Sentences {
  std::array<std::string, kCrashes.size()> crashed;
  std::string ended, stalled;
};
Sentences g_sentences;
std::atomic<bool> g_watching = false;
static_assert(std::atomic<bool>::is_always_lock_free);

[[noreturn]] void end_with(const std::string& sentence) {
  const ssize_t written = write(STDERR_FILENO, sentence.data(), sentence.size());
  (void)written;
  _exit(config::kExitBadConfiguration);
}

void on_crash(int signal) {
  for (std::size_t i = 0; i < kCrashes.size(); ++i)
    if (kCrashes[i] == signal) end_with(g_sentences.crashed[i]);
  _exit(config::kExitBadConfiguration);
}

void on_time(int /*signal*/) {
  end_with(g_sentences.stalled);
}

void on_exit() {
  if (g_watching) end_with(g_sentences.ended);
}

void arm_timer(Duration within) {
  itimerval timer{};
  timer.it_value.tv_sec = within.ns / 1'000'000'000;
  timer.it_value.tv_usec = within.ns % 1'000'000'000 / 1000;
  setitimer(ITIMER_REAL, &timer, nullptr);
}

}  // namespace

LoadWatch::LoadWatch(const std::string& what, Duration within) : stack_(new std::byte[kStackBytes]) {
  for (std::size_t i = 0; i < kCrashes.size(); ++i)
    g_sentences.crashed[i] =
        fmt::format("{}: crashed while it was loaded (SIG{}); correct the plugin, or the file that it reads\n", what,
                    sigabbrev_np(kCrashes[i]));
  g_sentences.ended = what + ": ended the process while it was loaded; correct the plugin\n";
  g_sentences.stalled =
      fmt::format("{}: was not loaded within {:g} s; correct the plugin, or raise policy.engine.load_within\n", what,
                  within.seconds());
  static const bool registered = std::atexit(on_exit) == 0;
  (void)registered;
  const stack_t stack{.ss_sp = stack_.get(), .ss_flags = 0, .ss_size = kStackBytes};
  sigaltstack(&stack, &stack_before_);
  const auto handle = [this](int signal, void (*handler)(int)) {
    struct sigaction action {};
    action.sa_handler = handler;
    action.sa_flags = SA_ONSTACK | SA_RESTART;
    before_.push_back({signal, {}});
    sigaction(signal, &action, &before_.back().action);
  };
  for (const int signal : kCrashes) handle(signal, on_crash);
  handle(SIGALRM, on_time);
  g_watching = true;
  arm_timer(within);
}

LoadWatch::~LoadWatch() {
  arm_timer({});
  g_watching = false;
  for (const Before& before : before_) sigaction(before.signal, &before.action, nullptr);
  sigaltstack(&stack_before_, nullptr);
}

}  // namespace takt::policy_host
