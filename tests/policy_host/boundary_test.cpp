// SPDX-License-Identifier: Apache-2.0
// Goal: a fenced process ends no other, empties and makes no file, and changes no other's scheduling class, with every
// version of Landlock; policies of root share no user. Method: a child behind the fence of each version tries; what it
// got done is its exit code.
#include "policy_host/boundary.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "executive/ipc/policy_users.hpp"
#include "policy_host/seccomp_program.hpp"

namespace takt::policy_host {
namespace {

namespace fs = std::filesystem;
constexpr int kOpenAt2 = 437;
enum Done : int { signalled = 1, signalled_thread = 2, emptied = 4, emptied_by_opening = 8, made = 16, demoted = 32 };

class Boundary : public testing::Test {
 protected:
  Boundary() { std::ofstream(file_) << "evidence"; }
  ~Boundary() override { fs::remove(file_); }

  // In a child.
  int what_it_gets_done() const {
    const pid_t other = getppid();
    int done = 0;
    if (kill(other, 0) == 0) done |= signalled;
    if (syscall(SYS_tgkill, other, other, 0) == 0) done |= signalled_thread;
    if (truncate(file_.c_str(), 1) == 0) done |= emptied;
    if (open(file_.c_str(), O_RDONLY | O_TRUNC | O_CLOEXEC) >= 0) done |= emptied_by_opening;
    struct {
      std::uint64_t flags = O_RDONLY | O_TRUNC, mode = 0, resolve = 0;
    } how;
    if (syscall(kOpenAt2, AT_FDCWD, file_.c_str(), &how, sizeof how) >= 0) done |= emptied_by_opening;
    if (open((file_ + ".new").c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600) >= 0) done |= made;
    const sched_param idle{};
    if (sched_setscheduler(other, SCHED_IDLE, &idle) == 0) done |= demoted;
    return done;
  }
  int done_behind(long landlock) const {
    const pid_t child = fork();
    if (child == 0) {
      (void)fence_in({}, landlock);
      const sched_param ordinary{};
      // What every program does: reads, signals itself, asks for the class that it has.
      const bool works = open(file_.c_str(), O_RDONLY | O_CLOEXEC) >= 0 && kill(getpid(), 0) == 0 &&
                         sched_setscheduler(gettid(), SCHED_OTHER, &ordinary) == 0;
      _exit(works ? what_it_gets_done() : 255);
    }
    int status = 0;
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  const std::string file_ = testing::TempDir() + "takt-fenced-" + std::to_string(getpid());
};

// Threat: policy-old-landlock
TEST_F(Boundary, HoldsWithEveryVersionOfLandlock) {
  for (const long landlock : {1, 2, 3, 5, 6, 7}) EXPECT_EQ(done_behind(landlock), 0) << landlock;
  EXPECT_EQ(fs::file_size(file_), 8U);
}

TEST_F(Boundary, WithoutLandlockFilesAreMadeAndNothingElse) {
  EXPECT_EQ(done_behind(0), made);
  EXPECT_EQ(fs::file_size(file_), 8U);
  fs::remove(file_ + ".new");
}

// A kernel without Landlock is played by a filter that knows none of its calls.
// Threat: policy-old-kernel
TEST_F(Boundary, WithoutLandlockFilesAreOfReadOnlyMountsButThoseGranted) {
  const fs::path granted = file_ + ".granted";
  fs::create_directory(granted);
  enum Outcome : int { changed = 1, made_beside = 2, not_made_where_granted = 4, not_made_here = 8, has_gaps = 16 };
  const pid_t child = fork();
  if (child == 0) {
    const std::array<sock_filter, 4> filter{statement(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
                                            jump(BPF_JMP | BPF_JEQ | BPF_K, SYS_landlock_create_ruleset, 0, 1),
                                            statement(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | ENOSYS),
                                            statement(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)};
    const sock_fprog program{.len = filter.size(), .filter = const_cast<sock_filter*>(filter.data())};
    fs::current_path(granted);
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 || syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, 0, &program) != 0)
      _exit(255);
    int outcome = go_behind_boundary({.writable = {granted}}).empty() ? 0 : has_gaps;
    const auto makes = [](const fs::path& path) {
      return open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600) >= 0;
    };
    if (open(file_.c_str(), O_RDWR | O_CLOEXEC) >= 0) outcome |= changed;
    if (makes(file_ + ".new")) outcome |= made_beside;
    if (!makes(granted / "new")) outcome |= not_made_where_granted;
    if (!makes("here")) outcome |= not_made_here;
    _exit(outcome);
  }
  int status = 0;
  waitpid(child, &status, 0);
  fs::remove_all(granted);
  ASSERT_TRUE(WIFEXITED(status));
  const int outcome = WEXITSTATUS(status);
  if ((outcome & has_gaps) != 0 && std::getenv("TAKT_REQUIRE_NAMESPACES") == nullptr)
    GTEST_SKIP() << "SKIPPED: this machine refuses a layer";
  EXPECT_EQ(outcome, 0);
}

// Two children behind the boundary try a file that root alone may read; the kernel says as whom.
// Threat: policy-fallback
TEST_F(Boundary, OfRootEachPolicyIsAUserOfItsOwnAndReadsWhatRootReads) {
  if (geteuid() != 0) GTEST_SKIP() << "SKIPPED: root's alone";
  fs::permissions(file_, fs::perms::owner_read);
  const auto behind = [&] {
    struct {
      uid_t user = 0;
      std::size_t gaps = 0;
      bool reads = false;
      pid_t pid = 0;
    } seen;
    std::array<int, 2> ends{};
    EXPECT_EQ(pipe2(ends.data(), O_CLOEXEC), 0);
    seen.pid = fork();
    if (seen.pid == 0) {
      seen.pid = getpid();
      seen.gaps = go_behind_boundary({}).size();
      seen.user = geteuid();
      seen.reads = open(file_.c_str(), O_RDONLY | O_CLOEXEC) >= 0;
      _exit(write(ends[1], &seen, sizeof seen) == sizeof seen ? 0 : 1);
    }
    close(ends[1]);
    EXPECT_EQ(read(ends[0], &seen, sizeof seen), static_cast<ssize_t>(sizeof seen));
    close(ends[0]);
    waitpid(seen.pid, nullptr, 0);
    return seen;
  };
  const auto first = behind(), second = behind();
  if (first.gaps != 0 && std::getenv("TAKT_REQUIRE_NAMESPACES") == nullptr)
    GTEST_SKIP() << "SKIPPED: this machine refuses a layer";
  for (const auto& seen : {first, second}) {
    EXPECT_EQ(seen.user, ipc::kFirstOwnUser + static_cast<uid_t>(seen.pid));
    EXPECT_TRUE(seen.reads);
  }
  EXPECT_NE(first.user, second.user);
}

TEST_F(Boundary, SaysWhatItLacks) {
  const auto gaps_of = [](long landlock) {
    int status = 0;
    const pid_t child = fork();
    if (child == 0) _exit(static_cast<int>(fence_in({}, landlock).size()));
    waitpid(child, &status, 0);
    return WEXITSTATUS(status);
  };
  EXPECT_EQ(gaps_of(0), 1);
  EXPECT_EQ(gaps_of(2), 0);
  EXPECT_EQ(gaps_of(7), 0);
}

}  // namespace
}  // namespace takt::policy_host
