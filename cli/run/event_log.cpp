// SPDX-License-Identifier: Apache-2.0
#include "cli/run/event_log.hpp"

#include <fcntl.h>
#include <time.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "monitor/record/run_events.hpp"
#include "monitor/record/run_manifest.hpp"

namespace takt::cli {
namespace {

std::int64_t unix_ns(MonoTime at) {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec - (monotonic_now() - at).ns;
}

}  // namespace

EventLog::~EventLog() {
  if (file_ >= 0) close(file_);
}

void EventLog::note(std::string_view event, const nlohmann::ordered_json& more, MonoTime at) {
  nlohmann::ordered_json line{{"event", event}, {"monotonic_ns", at.ns}, {"utc", monitor::utc_text(unix_ns(at))}};
  line.update(more);
  waiting_ += line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
  flush();
}

void EventLog::flush() {
  if (waiting_.empty()) return;
  const std::string path = run_folder_ + "/" + std::string(monitor::kEventsFile);
  if (file_ < 0) file_ = open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (file_ < 0) return;
  const ssize_t written = write(file_, waiting_.data(), waiting_.size());
  if (written > 0) waiting_.erase(0, static_cast<std::size_t>(written));
}

}  // namespace takt::cli
