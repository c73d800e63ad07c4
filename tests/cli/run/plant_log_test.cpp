// SPDX-License-Identifier: Apache-2.0
// Goal: each fault that the plant plays is read once, with the plant's own instant, however its log grows. Method: a
// log written in pieces that end within lines.
#include "cli/run/plant_log.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/temporary_folder.hpp"

namespace takt::cli {
namespace {

using PlantLogTest = test::TemporaryFolder;

TEST_F(PlantLogTest, ReadsEachFaultOnceWithItsInstant) {
  PlantLog log(path("takt-plant.log"));
  EXPECT_TRUE(log.news().empty()) << "no log yet";
  std::ofstream file(path("takt-plant.log"));
  file << "2026-11-21T09:33:00.100Z takt-plant info: 6 drives, stepping every 1.000 ms\n"
       << "2026-11-21T09:33:01.250Z takt-plant info: scenario: at 1.150 s: elbow: silent for 200 ms\n"
       << "2026-11-21T09:33:01.450Z takt-plant info: scenario: at 1.350 s: elb" << std::flush;
  const auto first = log.news();
  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].what, "elbow: silent for 200 ms");
  file << "ow: end of silent for 200 ms\nscenario: at nowhere\n" << std::flush;
  const auto second = log.news();
  ASSERT_EQ(second.size(), 1U);
  EXPECT_EQ(second[0].what, "elbow: end of silent for 200 ms");
  // Both are told by the clock of now; what lies between two calls is not the fault's length.
  EXPECT_NEAR((second[0].at - first[0].at).seconds(), 0.2, 0.1);
  EXPECT_TRUE(log.news().empty());
}

}  // namespace
}  // namespace takt::cli
