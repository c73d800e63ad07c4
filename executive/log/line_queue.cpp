// SPDX-License-Identifier: Apache-2.0
#include "executive/log/line_queue.hpp"

#include <poll.h>
#include <pthread.h>
#include <unistd.h>

#include <cerrno>
#include <condition_variable>
#include <csignal>
#include <deque>
#include <mutex>
#include <string_view>
#include <system_error>
#include <utility>

namespace takt::log {
namespace {

constexpr std::size_t kStackBytes = std::size_t{256} << 10U;  // resident where memory is locked

// Waits for the reader for as long as it takes. False: the descriptor is broken.
bool write_whole(int fd, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = write(fd, text.data(), text.size());
    if (written >= 0) {
      text.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno == EAGAIN) {  // a process that shares the descriptor made it non-blocking
      pollfd room{fd, POLLOUT, 0};
      poll(&room, 1, -1);
    } else if (errno != EINTR) {
      return false;
    }
  }
  return true;
}

std::string confession(std::uint64_t lines) {
  return std::to_string(lines) + " log lines dropped: not read in time\n";
}

}  // namespace

struct LineQueue::Shared {
  const int fd;
  const std::size_t capacity;
  mutable std::mutex mutex{};
  std::condition_variable work{}, idle{};
  std::deque<std::string> lines{};
  std::uint64_t dropped = 0;
  std::uint64_t confessed = 0;
  bool writing = false;
  bool ending = false;

  void write_lines();
  // What to write next, with the lock held; it is being written until the next call.
  std::string take();
};

std::string LineQueue::Shared::take() {
  std::string text;
  if (const std::uint64_t more = dropped - confessed; more != 0) text = confession(more);
  confessed = dropped;
  text += lines.front();
  lines.pop_front();
  return text;
}

void LineQueue::Shared::write_lines() {
  std::unique_lock lock(mutex);
  while (true) {
    work.wait(lock, [this] { return ending || !lines.empty(); });
    if (lines.empty()) return;
    const std::string text = take();
    writing = true;
    lock.unlock();
    const bool written = write_whole(fd, text);
    lock.lock();
    writing = false;
    if (!written) ++dropped;
    if (lines.empty()) idle.notify_all();
  }
}

void* LineQueue::write_for(void* share) {
  const std::unique_ptr<std::shared_ptr<Shared>> shared(static_cast<std::shared_ptr<Shared>*>(share));
  pthread_setname_np(pthread_self(), "takt-log");
  (*shared)->write_lines();
  return nullptr;
}

LineQueue::LineQueue(int fd, std::size_t capacity) : shared_(new Shared{fd, capacity}) {
  // Signals are for the threads that know what to do about them: the writer inherits a mask that blocks all.
  sigset_t every_signal, before;
  sigfillset(&every_signal);
  pthread_sigmask(SIG_SETMASK, &every_signal, &before);
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, kStackBytes);
  pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
  auto share = std::make_unique<std::shared_ptr<Shared>>(shared_);
  pthread_t writer{};
  const int error = pthread_create(&writer, &attributes, write_for, share.get());
  pthread_attr_destroy(&attributes);
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  if (error != 0) throw std::system_error(error, std::generic_category(), "no thread for the log");
  (void)share.release();  // the writer's
}

LineQueue::~LineQueue() {
  (void)drain(kLastWords);
  const std::scoped_lock lock(shared_->mutex);
  shared_->ending = true;
  shared_->work.notify_one();
}

void LineQueue::push(std::string line) {
  {
    const std::scoped_lock lock(shared_->mutex);
    if (shared_->lines.size() == shared_->capacity) {
      shared_->lines.pop_front();
      ++shared_->dropped;
    }
    shared_->lines.push_back(std::move(line));
  }
  shared_->work.notify_one();
}

bool LineQueue::drain(std::chrono::milliseconds patience) {
  std::unique_lock lock(shared_->mutex);
  return shared_->idle.wait_for(lock, patience, [this] { return shared_->lines.empty() && !shared_->writing; });
}

std::uint64_t LineQueue::dropped() const {
  const std::scoped_lock lock(shared_->mutex);
  return shared_->dropped;
}

}  // namespace takt::log
