// SPDX-License-Identifier: Apache-2.0
// Goal: what is usual in a run's answers is what its own policy answered. Method: a recorded run of the virtual robot,
// in which another policy is in charge for a while.
#include "evidence/review/usual_stretches.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

class UsualStretches : public test::TemporaryFolder {};

TEST_F(UsualStretches, StretchesOfAnotherPolicyAreNotTheRuns) {
  const RecordedRun run = record_demo(path("run"));
  const auto stretches = [&](std::uint64_t first, std::uint64_t last) {
    const auto by_another = [&](TickRecord& record) {
      if (record.header.tick >= first && record.header.tick <= last) record.header.command_policy = 5;
    };
    std::filesystem::remove_all(path("copy"));
    const auto all = [](std::uint64_t) { return true; };
    const RecordedRun copy = altered_copy(
        run, path("copy"), by_another, [](RecordedCommand&) {}, all, Checksums::made_anew);
    const auto found = evidence::usual_stretches(copy, milliseconds(100));
    return found ? found->size() : 0;
  };
  const std::size_t whole = stretches(1, 0);
  EXPECT_GT(whole, 15U);
  EXPECT_EQ(stretches(1, kDemoTicks), 0U);
  const std::size_t without = stretches(1'001, 1'300);
  EXPECT_LE(without, whole - 3);
  EXPECT_GE(without, whole - 4);
}

}  // namespace
}  // namespace takt::monitor
