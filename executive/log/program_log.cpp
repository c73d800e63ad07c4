#include "executive/log/program_log.hpp"

#include <fmt/format.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <csignal>
#include <memory>
#include <mutex>

#include "executive/log/line_queue.hpp"

namespace takt::log {
namespace {

constexpr std::size_t kLines = 1024;

class QueueSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  QueueSink() : lines_(STDERR_FILENO, kLines) {}

 private:
  void sink_it_(const spdlog::details::log_msg& message) override {
    spdlog::memory_buf_t text;
    formatter_->format(message, text);
    lines_.push(fmt::to_string(text));
  }
  void flush_() override { (void)lines_.drain(kLastWords); }

  LineQueue lines_;
};

}  // namespace

void log_to_stderr(const std::string& program) {
  std::signal(SIGPIPE, SIG_IGN);
  spdlog::set_default_logger(std::make_shared<spdlog::logger>(program, std::make_shared<QueueSink>()));
  spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%e %n %l: %v");
}

}  // namespace takt::log
