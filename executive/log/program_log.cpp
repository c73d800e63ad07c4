// SPDX-License-Identifier: Apache-2.0
#include "executive/log/program_log.hpp"

#include <fmt/format.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <memory>
#include <mutex>

#include "executive/log/line_queue.hpp"

namespace takt::log {
namespace {

constexpr std::size_t kLines = 1024;

// systemd says in JOURNAL_STREAM which device and inode are the journal's (systemd.exec(5)); a program that a person
// starts in a terminal may have inherited it.
bool is_the_journal(int file) {
  const char* const stream = std::getenv("JOURNAL_STREAM");
  struct stat entry {};
  return stream != nullptr && ::fstat(file, &entry) == 0 && fmt::format("{}:{}", entry.st_dev, entry.st_ino) == stream;
}

// sd-daemon(3): what `journalctl -p` chooses lines by.
int priority_of(spdlog::level::level_enum level) {
  if (level >= spdlog::level::critical) return 2;
  if (level == spdlog::level::err) return 3;
  if (level == spdlog::level::warn) return 4;
  return level == spdlog::level::info ? 6 : 7;
}

class QueueSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  QueueSink() : says_priority_(is_the_journal(STDERR_FILENO)), lines_(STDERR_FILENO, kLines) {}

 private:
  void sink_it_(const spdlog::details::log_msg& message) override {
    spdlog::memory_buf_t text;
    formatter_->format(message, text);
    lines_.push((says_priority_ ? fmt::format("<{}>", priority_of(message.level)) : "") + fmt::to_string(text));
  }
  void flush_() override { (void)lines_.drain(kLastWords); }

  bool says_priority_;
  LineQueue lines_;
};

}  // namespace

void log_to_stderr(const std::string& program) {
  std::signal(SIGPIPE, SIG_IGN);
  spdlog::set_default_logger(std::make_shared<spdlog::logger>(program, std::make_shared<QueueSink>()));
  spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%eZ %n %l: %v", spdlog::pattern_time_type::utc);
}

}  // namespace takt::log
