// SPDX-License-Identifier: Apache-2.0
// Goal: the summary line's figures are those of the window just ended. Method: 100 inferences of 1..100 ms in 10 s.
#include "policy_host/host_statistics.hpp"

#include <gtest/gtest.h>

namespace takt::policy_host {
namespace {

TEST(HostStatistics, SummarisesOneWindowAndStartsOver) {
  HostStatistics statistics;
  for (int i = 100; i >= 1; --i) {
    CommandHeader header;
    header.infer_started_at = MonoTime{} + seconds(i);
    header.infer_ended_at = header.infer_started_at + milliseconds(i);
    header.dropped_observations = i == 50 ? 3 : 0;
    statistics.add(header);
  }
  statistics.withheld();
  statistics.overtaken();
  EXPECT_EQ(statistics.summary(seconds(10)),
            "10.0 commands/s, inference p50 50.000 ms p99 99.000 ms, 3 observations dropped, 1 withheld, "
            "1 answers overtaken");
  EXPECT_EQ(statistics.summary(seconds(10)),
            "0.0 commands/s, inference p50 0.000 ms p99 0.000 ms, 0 observations dropped, 0 withheld, "
            "0 answers overtaken");
}

}  // namespace
}  // namespace takt::policy_host
