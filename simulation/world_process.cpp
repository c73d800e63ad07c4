#include "simulation/world_process.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <utility>

#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/unix_socket.hpp"

namespace takt::plant {
namespace {

constexpr Duration kLookAgain = milliseconds(10);

std::string with_socket(std::string command, const std::string& socket) {
  for (std::size_t at = command.find(WorldProcess::kPlace); at != std::string::npos;
       at = command.find(WorldProcess::kPlace, at + socket.size()))
    command.replace(at, WorldProcess::kPlace.size(), socket);
  return command;
}

[[noreturn]] void run_shell(const std::string& command, const sigset_t& signals) {
  ::setpgid(0, 0);
  ::sigprocmask(SIG_UNBLOCK, &signals, nullptr);
  ::dup2(STDERR_FILENO, STDOUT_FILENO);  // ours has tables and JSON
  ::execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
  ::_exit(127);
}

// In a child of ours: a shell's children do not die with it, nor it with us. This one does, and takes the group along.
// Ends as the command does, or when it is told to. After a fork: calls that are safe in signal handlers only.
[[noreturn]] void keep(const std::string& command, pid_t parent) {
  sigset_t signals;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGTERM);
  ::sigaddset(&signals, SIGCHLD);
  ::sigprocmask(SIG_BLOCK, &signals, nullptr);
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(1);
  ::setpgid(0, 0);  // Ctrl-C is for the one that we belong to
  const pid_t shell = ::fork();
  if (shell < 0) ::_exit(1);
  if (shell == 0) run_shell(command, signals);
  ::setpgid(shell, shell);  // whoever of the two comes first
  int status = 0, signal = 0;
  while (signal != SIGTERM && ::waitpid(shell, &status, WNOHANG) == 0) signal = ::sigwaitinfo(&signals, nullptr);
  ::kill(-shell, SIGKILL);
  ::_exit(WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status));
}

}  // namespace

WorldProcess::WorldProcess(std::string socket_or_command) : WorldProcess(std::move(socket_or_command), Patience{}) {}

WorldProcess::WorldProcess(std::string socket_or_command, const Patience& patience)
    : text_(std::move(socket_or_command)), patience_(patience) {}

WorldProcess::~WorldProcess() {
  give_up();
}

void WorldProcess::give_up() {
  // A forked copy has not started the process that it knows of.
  if (process_ > 0 && owner_ == ::getpid()) {
    ::kill(process_, SIGTERM);
    ::waitpid(process_, nullptr, 0);
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  process_ = owner_ = 0;
}

std::expected<void, WorldEnd> WorldProcess::start() {
  const auto absent = [this](const std::string& what) {
    return std::unexpected(WorldEnd{WorldEndKind::absent, fmt::format("world `{}`: {}", text_, what)});
  };
  std::string pattern = (std::filesystem::temp_directory_path() / "takt-world.XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) return absent("no folder for its socket: " + ipc::errno_text());
  folder_ = pattern;
  socket_ = folder_ + "/world.sock";
  const std::string command = with_socket(text_, socket_);
  owner_ = ::getpid();
  const pid_t pid = ::fork();
  if (pid < 0) return absent("no process for it: " + ipc::errno_text());
  if (pid == 0) keep(command, owner_);
  process_ = pid;
  for (const MonoTime deadline = monotonic_now() + patience_.start; !std::filesystem::exists(socket_);
       sleep_until(monotonic_now() + kLookAgain)) {
    siginfo_t ended{};
    ::waitid(P_PID, static_cast<id_t>(pid), &ended, WEXITED | WNOHANG | WNOWAIT);
    if (ended.si_pid != 0) {
      int status = 0;
      ::waitpid(pid, &status, 0);
      process_ = 0;
      std::error_code ignored;
      std::filesystem::remove_all(folder_, ignored);
      return absent(fmt::format("exited with {} before it listened; what it said is above", WEXITSTATUS(status)));
    }
    if (monotonic_now() < deadline) continue;
    give_up();
    return absent(fmt::format("did not listen at {} within {:.0f} s", socket_, patience_.start.seconds()));
  }
  return {};
}

std::expected<std::unique_ptr<OutsideMechanics>, WorldEnd> WorldProcess::begin(const config::RobotConfig& robot,
                                                                               std::uint64_t seed) {
  if (!is_command(text_)) return OutsideMechanics::connect(robot, text_, seed, patience_.link);
  if (process_ == 0 || owner_ != ::getpid()) {
    if (auto started = start(); !started) return std::unexpected(started.error());
  }
  return OutsideMechanics::connect(robot, socket_, seed, patience_.link);
}

std::expected<WorldFacts, WorldEnd> WorldProcess::ask(const config::RobotConfig& robot) {
  const auto begun = begin(robot, robot.simulation->seed);
  give_up();
  if (!begun) return std::unexpected(begun.error());
  const WorldLink& link = (*begun)->link();
  return WorldFacts{link.world(), link.gives()};
}

}  // namespace takt::plant
