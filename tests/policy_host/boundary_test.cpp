// SPDX-License-Identifier: Apache-2.0
// Goal: a fenced process ends no other, empties and makes no file, and changes no other's scheduling class, with every
// version of Landlock. Method: a child behind the fence of each version tries; what it got done is its exit code.
#include "policy_host/boundary.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

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

// Threat: policy-old-kernel
TEST_F(Boundary, HoldsWithEveryVersionOfLandlock) {
  for (const long landlock : {1, 2, 3, 5, 6, 7}) EXPECT_EQ(done_behind(landlock), 0) << landlock;
  EXPECT_EQ(fs::file_size(file_), 8U);
}

TEST_F(Boundary, WithoutLandlockFilesAreMadeAndNothingElse) {
  EXPECT_EQ(done_behind(0), made);
  EXPECT_EQ(fs::file_size(file_), 8U);
  fs::remove(file_ + ".new");
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
