// SPDX-License-Identifier: Apache-2.0
#include "lab/panel/worker_pool.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "lab/artifact/rollout_json.hpp"

namespace takt::lab {
namespace {

constexpr char kErrorMark = '!';  // a line that begins with it is no row but a sentence

constexpr std::ptrdiff_t kReportLines = 2;

bool write_all(int fd, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(fd, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

// What a worker says of one rollout: a line with the row and a line with its post-mortem as a JSON text, or one line
// with an error.
std::string report_of(const std::expected<RanRollout, std::string>& ran, bool& failed) {
  const auto row = ran ? row_text(ran->row) : std::unexpected(ran.error());
  failed = !row;
  if (failed) return kErrorMark + row.error() + "\n";
  return *row + "\n" + nlohmann::json(ran->post_mortem).dump() + "\n";
}

std::expected<RanRollout, std::string> ran_of(const std::string& row_line, const std::string& post_mortem_line) {
  auto row = row_of(row_line);
  if (!row) return std::unexpected(row.error());
  return RanRollout{std::move(*row), nlohmann::json::parse(post_mortem_line).get<std::string>()};
}

// In the child. Never returns. Ends when the reader of what it writes is gone.
[[noreturn]] void work(Contest& contest, std::span<const PlannedRollout> rollouts, std::size_t first,
                       std::size_t stride, int out) {
  ::signal(SIGPIPE, SIG_IGN);
  for (std::size_t i = first; i < rollouts.size(); i += stride) {
    bool failed = false;
    const std::string report = report_of(contest.run(rollouts[i]), failed);
    if (write_all(out, report) && !failed) continue;
    contest.clean_up();
    std::_Exit(1);
  }
  contest.clean_up();
  std::_Exit(0);
}

class Worker {
 public:
  Worker(pid_t pid, int in) : pid_(pid), in_(in) {}
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;
  ~Worker() {
    if (in_ >= 0) ::close(in_);
    if (!has_ended_) ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }

  // `others`: the workers that run already.
  static std::expected<std::unique_ptr<Worker>, std::string> start(Contest& contest,
                                                                   std::span<const PlannedRollout> rollouts,
                                                                   std::size_t first, std::size_t stride,
                                                                   std::span<const std::unique_ptr<Worker>> others) {
    std::array<int, 2> pipe{};
    if (::pipe2(pipe.data(), O_CLOEXEC) != 0) return refusal("no pipe for a worker");
    std::fflush(nullptr);
    const pid_t pid = ::fork();
    if (pid < 0) return refusal("no worker process");
    if (pid == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      ::close(pipe[0]);
      for (const auto& other : others) ::close(other->in_);
      work(contest, rollouts, first, stride, pipe[1]);
    }
    ::close(pipe[1]);
    return std::make_unique<Worker>(pid, pipe[0]);
  }

  [[nodiscard]] int descriptor() const { return in_; }
  // Blocks until something comes; false: nothing more will.
  bool read_more() {
    std::array<char, 65536> buffer{};
    const ssize_t got = ::read(in_, buffer.data(), buffer.size());
    if (got < 0 && errno == EINTR) return true;
    if (got <= 0) {
      has_ended_ = true;
      return false;
    }
    text_.append(buffer.data(), static_cast<std::size_t>(got));
    for (std::size_t end = text_.find('\n'); end != std::string::npos; end = text_.find('\n')) {
      lines_.push_back(text_.substr(0, end));
      text_.erase(0, end + 1);
    }
    return true;
  }
  std::deque<std::string>& lines() { return lines_; }
  // Nothing is wanted of it any more: it puts away what it started, and ends.
  void let_end() {
    while (read_more()) {
    }
  }
  // The rest of its rollouts is not wanted: it ends after the one that it plays.
  void dismiss() {
    ::close(in_);
    in_ = -1;
    has_ended_ = true;
  }

 private:
  static std::unexpected<std::string> refusal(const char* what) {
    return std::unexpected(fmt::format("{}: {}", what, std::strerror(errno)));
  }
  pid_t pid_;
  int in_;
  bool has_ended_ = false;  // its end of the pipe is closed
  std::string text_;
  std::deque<std::string> lines_;
};

bool is_whole_report(const std::deque<std::string>& lines) {
  return std::ssize(lines) >= kReportLines || (!lines.empty() && lines[0].starts_with(kErrorMark));
}

using Workers = std::vector<std::unique_ptr<Worker>>;

// Reads from whichever worker has something to say. False: worker `wanted` will not say anything more.
bool wait_for(Workers& workers, std::size_t wanted) {
  std::vector<pollfd> ready;
  for (const auto& worker : workers) ready.push_back({worker->descriptor(), POLLIN, 0});
  if (::poll(ready.data(), ready.size(), -1) < 0) return errno == EINTR;
  for (std::size_t i = 0; i < workers.size(); ++i) {
    if ((ready[i].revents & (POLLIN | POLLHUP)) == 0) continue;
    if (!workers[i]->read_more() && i == wanted && !is_whole_report(workers[i]->lines())) return false;
  }
  return true;
}

}  // namespace

std::expected<void, std::string> run_in_workers(Contest& contest, std::span<const PlannedRollout> rollouts,
                                                std::size_t workers, const DeliverRow& deliver,
                                                const IsEnough& is_enough) {
  const std::size_t count = std::min(std::max<std::size_t>(workers, 1), std::max<std::size_t>(rollouts.size(), 1));
  Workers running;
  for (std::size_t i = 0; i < count; ++i) {
    auto worker = Worker::start(contest, rollouts, i, count, running);
    if (!worker) return std::unexpected(worker.error());
    running.push_back(std::move(*worker));
  }
  for (std::size_t i = 0; i < rollouts.size(); ++i) {
    if (is_enough && is_enough()) {
      for (const auto& worker : running) worker->dismiss();
      return {};
    }
    std::deque<std::string>& lines = running[i % count]->lines();
    while (!is_whole_report(lines))
      if (!wait_for(running, i % count))
        return std::unexpected(
            fmt::format("a worker died during rollout {}", evidence::rollout_id(contest.identity(rollouts[i]))));
    if (lines[0].starts_with(kErrorMark)) return std::unexpected(lines[0].substr(1));
    const auto ran = ran_of(lines[0], lines[1]);
    lines.erase(lines.begin(), lines.begin() + kReportLines);
    if (!ran) return std::unexpected(ran.error());
    if (const auto done = deliver(*ran); !done) return std::unexpected(done.error());
  }
  for (const auto& worker : running) worker->let_end();
  return {};
}

}  // namespace takt::lab
