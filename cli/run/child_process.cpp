// SPDX-License-Identifier: Apache-2.0
#include "cli/run/child_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string_view>
#include <thread>
#include <utility>

#include "cli/run/external_tool.hpp"
#include "config/load.hpp"
#include "policy_host/processor_fence.hpp"

namespace takt::cli {
namespace {

constexpr std::size_t kLastWords = 5;
// What a policy says that its boundary kept from something.
constexpr std::array<std::string_view, 3> kByBoundary{"Permission denied", "Operation not permitted",
                                                      "Network is unreachable"};

// Between fork and exec. What it says goes to the program's log; what its boundary lacks, a line each, to the parent.
void keep_in(const PolicyPlace& place, const std::string& name, int gaps) {
  policy_host::limit_thread_pools(place.threads, policy_host::PoolSize::unless_set);
  const auto fence = policy_host::keep_off_processor(place.off_cpu);
  if (!fence) {
    dprintf(STDERR_FILENO, "%s: %s\n", name.c_str(), fence.error().c_str());
    _exit(config::kExitBadConfiguration);
  }
  for (const std::string& gap : policy_host::go_behind_boundary(place.grants)) dprintf(gaps, "%s\n", gap.c_str());
}

[[noreturn]] void become(const ChildProcess::Options& options, char* const* argv, pid_t parent, int gaps) {
  if (options.place)
    setsid();
  else
    setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, options.parent_death_signal);
  if (getppid() != parent) _exit(1);  // the parent died before the line above took effect
  signal(SIGPIPE, SIG_DFL);           // what we ignore is not theirs to ignore
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  const int null = open("/dev/null", O_RDONLY | O_CLOEXEC);
  const int log = open(options.log_path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (null < 0 || log < 0) _exit(1);
  dup2(null, STDIN_FILENO);
  dup2(log, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
  // A tracing daemon that hangs must not delay a robot's start (docs/tracing.md). NOLINTNEXTLINE(concurrency-mt-unsafe)
  setenv("LTTNG_UST_REGISTER_TIMEOUT", "0", 0);
  if (options.place) {
    keep_in(*options.place, options.name, gaps);
    prctl(PR_SET_PDEATHSIG, options.parent_death_signal);  // new credentials may have none
  }
  execv(argv[0], argv);
  dprintf(STDERR_FILENO, "%s: %s\n", argv[0], std::strerror(errno));
  _exit(127);
}

// Until it has become the program, which closes the other end.
std::vector<std::string> lines_from(int end) {
  std::vector<std::string> lines;
  std::istringstream text(read_all(end));
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return lines;
}

}  // namespace

PolicyPlace place_of_policy(const config::RobotConfig& robot, policy_host::Grants grants) {
  const bool chosen = robot.policy && robot.policy->engine;
  return {robot.control.cpu, (chosen ? *robot.policy->engine : config::Engine{}).threads, std::move(grants)};
}

std::expected<ChildProcess, std::string> ChildProcess::start(Options options) {
  std::vector<char*> argv;
  for (std::string& argument : options.arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  std::array<int, 2> gaps{-1, -1};
  if (pipe2(gaps.data(), O_CLOEXEC) != 0)
    return std::unexpected(fmt::format("no pipe: {}; close some files", std::strerror(errno)));
  const pid_t parent = getpid();
  const pid_t pid = fork();
  if (pid == 0) become(options, argv.data(), parent, gaps[1]);
  close(gaps[1]);
  std::vector<std::string> said = lines_from(gaps[0]);
  close(gaps[0]);
  if (pid < 0)
    return std::unexpected(
        fmt::format("{} could not be started: {}; free some processes", options.name, std::strerror(errno)));
  ChildProcess child(std::move(options), pid);
  child.gaps_ = std::move(said);
  child.log_ = ipc::Descriptor(open(child.options_.log_path.c_str(), O_RDONLY | O_CLOEXEC));
  return child;
}

ChildProcess::ChildProcess(ChildProcess&& other) noexcept
    : options_(std::move(other.options_)),
      log_(std::move(other.log_)),
      pid_(std::exchange(other.pid_, -1)),
      gaps_(std::move(other.gaps_)),
      dropped_bytes_(other.dropped_bytes_),
      wait_status_(std::exchange(other.wait_status_, std::nullopt)) {}

ChildProcess& ChildProcess::operator=(ChildProcess&& other) noexcept {
  std::swap(options_, other.options_);
  std::swap(log_, other.log_);
  std::swap(pid_, other.pid_);
  std::swap(gaps_, other.gaps_);
  std::swap(dropped_bytes_, other.dropped_bytes_);
  std::swap(wait_status_, other.wait_status_);
  return *this;
}

ChildProcess::~ChildProcess() {
  if (pid_ <= 0 || !is_there()) return;
  tell(SIGKILL);
  reap(0);
}

bool ChildProcess::reap(int flags) {
  int status = 0;
  if (wait_status_ || waitpid(pid_, &status, flags) != pid_) return wait_status_.has_value();
  wait_status_ = status;
  cut_log();
  if (dropped_bytes_ != 0)
    std::ofstream(log_file(), std::ios::app)
        << fmt::format("\n{}: at least {} bytes beyond {} MiB of log were dropped\n", options_.name, dropped_bytes_,
                       kLogBudget_bytes >> 20U);
  return true;
}

// It appends, so that a shorter file stays in use. What it says between the two calls is lost uncounted.
void ChildProcess::cut_log() {
  std::error_code error;
  if (!options_.place) return;
  const std::uintmax_t size_bytes = std::filesystem::file_size(log_file(), error);
  if (error || size_bytes <= kLogBudget_bytes) return;
  std::filesystem::resize_file(log_file(), kLogBudget_bytes, error);
  if (!error) dropped_bytes_ += size_bytes - kLogBudget_bytes;
}

bool ChildProcess::alive() {
  if (!reap(WNOHANG)) cut_log();
  return !wait_status_;
}

void ChildProcess::signal(int number) const {
  if (pid_ > 0 && !wait_status_) kill(pid_, number);
}

// The group's number is taken as long as one process is in it, and they are this process's children once their parent
// is gone (RobotProcesses is a subreaper).
bool ChildProcess::is_there() {
  if (alive()) return true;
  if (!options_.with_its_group) return false;
  while (waitpid(-pid_, nullptr, WNOHANG) > 0) {
  }
  return kill(-pid_, 0) == 0;
}

void ChildProcess::tell(int number) const {
  if (options_.with_its_group)
    kill(-pid_, number);
  else
    signal(number);
}

void ChildProcess::end(std::chrono::milliseconds limit) {
  constexpr auto kPollEvery = std::chrono::milliseconds(5);
  if (pid_ <= 0 || !is_there()) return;
  tell(SIGTERM);
  tell(SIGCONT);
  for (auto waited = std::chrono::milliseconds(0); waited < limit && is_there(); waited += kPollEvery)
    std::this_thread::sleep_for(kPollEvery);
  if (!is_there()) return;
  tell(SIGKILL);
  reap(0);
}

std::string ChildProcess::how_it_ended() const {
  if (!wait_status_) return {};
  if (WIFEXITED(*wait_status_)) return fmt::format("exited with {}", WEXITSTATUS(*wait_status_));
  return "was killed by " + ended_by();
}

std::string ChildProcess::ended_by() const {
  if (!wait_status_ || WIFEXITED(*wait_status_)) return {};
  const char* abbreviation = sigabbrev_np(WTERMSIG(*wait_status_));
  return fmt::format("SIG{}", abbreviation ? abbreviation : "?");
}

std::optional<int> ChildProcess::exit_code() const {
  if (!wait_status_) return std::nullopt;
  return WIFEXITED(*wait_status_) ? WEXITSTATUS(*wait_status_) : 128 + WTERMSIG(*wait_status_);
}

std::string ChildProcess::log_file() const {
  return log_.is_open() ? fmt::format("/proc/self/fd/{}", log_.get()) : options_.log_path;
}

std::string ChildProcess::last_words() const {
  std::ifstream log(log_file());
  std::deque<std::string> lines;
  for (std::string line; std::getline(log, line);) {
    lines.push_back("  " + line + "\n");
    if (lines.size() > kLastWords) lines.pop_front();
  }
  std::string text;
  for (const std::string& line : lines) text += line;
  const auto names = [&text](std::string_view error) { return text.find(error) != std::string::npos; };
  if (options_.place && !options_.place->grants.everything && std::ranges::any_of(kByBoundary, names))
    text += "  a policy changes no file and has no network but what --policy-may grants (docs/policies.md)\n";
  if (names("No module named 'takt'"))
    text += "  name the Python package's folder in PYTHONPATH, or install it (docs/python-policy.md#install)\n";
  return text;
}

}  // namespace takt::cli
