// SPDX-License-Identifier: Apache-2.0
#include "cli/run/event_log.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "monitor/record/run_events.hpp"

namespace takt::cli {

EventLog::~EventLog() {
  if (file_ >= 0) close(file_);
}

void EventLog::note(std::string_view event, const nlohmann::ordered_json& more, MonoTime at) {
  waiting_ += monitor::event_line(event, at, more);
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
