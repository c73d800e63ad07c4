// SPDX-License-Identifier: Apache-2.0
// Goal: a line that goes to the journal begins with its priority, one that goes elsewhere does not, and both say their
// instant in UTC. Method: a forked program logs into a pipe that JOURNAL_STREAM names, or does not; in another zone.
#include "executive/log/program_log.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <ctime>
#include <string>

namespace takt::log {
namespace {

std::string logged(bool to_journal) {
  std::array<int, 2> ends{};
  if (::pipe(ends.data()) != 0) return "no pipe";
  struct stat entry {};
  ::fstat(ends[1], &entry);
  const pid_t child = ::fork();
  if (child == 0) {
    ::dup2(ends[1], STDERR_FILENO);
    ::setenv("TZ", "Asia/Kolkata", 1);
    ::setenv("JOURNAL_STREAM", fmt::format("{}:{}", entry.st_dev, to_journal ? entry.st_ino : entry.st_ino + 1).c_str(),
             1);
    log_to_stderr("tester");
    spdlog::warn("a warning");
    spdlog::info("a fact");
    spdlog::default_logger()->flush();
    ::_exit(0);
  }
  ::close(ends[1]);
  std::string text;
  std::array<char, 512> part{};
  for (ssize_t got = 0; (got = ::read(ends[0], part.data(), part.size())) > 0;)
    text.append(part.data(), static_cast<std::size_t>(got));
  ::close(ends[0]);
  ::waitpid(child, nullptr, 0);
  return text;
}

std::string hour_in_utc() {
  const std::time_t now = std::time(nullptr);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:", std::gmtime(&now));
  return text.data();
}

TEST(ProgramLog, TellsTheJournalHowBadALineIs) {
  const std::string text = logged(true);
  EXPECT_EQ(text.find("<4>"), 0U) << text;
  EXPECT_NE(text.find("\n<6>"), std::string::npos) << text;
}

TEST(ProgramLog, SaysInstantsInUtc) {
  const std::string before = hour_in_utc(), text = logged(false), after = hour_in_utc();
  EXPECT_TRUE(text.starts_with(before) || text.starts_with(after)) << text;
  EXPECT_EQ(text.find("Z tester warning: a warning\n"), before.size() + 9) << text;
}

}  // namespace
}  // namespace takt::log
