// SPDX-License-Identifier: Apache-2.0
// Goal: thinning out loses no spike and invents nothing. Method: hand-made ticks whose extremes, masks and counters are
// known, gathered into buckets of ten.
#include "evidence/review/report/sample_block.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

namespace takt::monitor {
namespace {

constexpr std::size_t kJoints = 2, kBuses = 1;

class SampleBlockTest : public testing::Test {
 protected:
  // A tick with a fresh command of `age_ms`; `alter` changes it further.
  template <class Alter>
  void tick(std::uint64_t number, double age_ms, const Alter& alter) {
    auto record = std::make_unique<TickRecord>();
    record->header.tick = number;
    record->header.joint_count = kJoints;
    record->header.bus_count = kBuses;
    record->header.seats[Seat::policy].freshness = Freshness::fresh;
    record->header.age.infer = {static_cast<std::int64_t>(age_ms * 1e6)};
    alter(*record);
    builder_.tick(*record, 0.001 * static_cast<double>(number), context_);
  }
  void tick(std::uint64_t number, double age_ms) {
    tick(number, age_ms, [](TickRecord&) {});
  }
  static const std::vector<float>& column(const evidence::SampleBlock& block, const std::string& name) {
    const auto found = std::ranges::find(block.columns, name, &evidence::SampleColumn::name);
    if (found == block.columns.end()) throw std::runtime_error("no column " + name);
    return found->values;
  }

  evidence::TickContext context_;
  evidence::SampleBlockBuilder builder_{kJoints, kBuses, false, 10, milliseconds(1)};
};

TEST_F(SampleBlockTest, ABucketKeepsItsExtremesAndTheOldestCommandsParts) {
  for (std::uint64_t number = 1; number <= 20; ++number) tick(number, number == 7 ? 90 : number == 3 ? 5 : 20);
  const evidence::SampleBlock block = builder_.finish();
  ASSERT_EQ(block.rows(), 2U);
  EXPECT_FLOAT_EQ(column(block, "age")[0], 5);
  EXPECT_FLOAT_EQ(column(block, "age.spread")[0], 85);
  EXPECT_FLOAT_EQ(column(block, "infer")[0], 90);
  EXPECT_FLOAT_EQ(column(block, "age.spread")[1], 0);
  EXPECT_DOUBLE_EQ(block.at_s[1], 0.011);
}

TEST_F(SampleBlockTest, JointsAreThinnedOneByOne) {
  for (std::uint64_t number = 1; number <= 10; ++number) {
    tick(number, 1, [&](TickRecord& record) {
      record.joints[1].feedback.q = number == 4 ? -1.5F : 0.25F;
      record.joints[1].q_reference = number == 9 ? 2.0F : 1.0F;
    });
  }
  const evidence::SampleBlock block = builder_.finish();
  EXPECT_FLOAT_EQ(column(block, "q1")[0], -1.5);
  EXPECT_FLOAT_EQ(column(block, "q1.spread")[0], 1.75);
  EXPECT_FLOAT_EQ(column(block, "reference1")[0], 1.0);
  EXPECT_FLOAT_EQ(column(block, "reference1.spread")[0], 1.0);
  EXPECT_FLOAT_EQ(column(block, "q0.spread")[0], 0.0);
}

// Speed and torque keep their largest with its sign, temperature its highest; gains are those told last.
TEST_F(SampleBlockTest, AJointsStrainKeepsItsPeaks) {
  for (std::uint64_t number = 1; number <= 10; ++number) {
    tick(number, 1, [&](TickRecord& record) {
      JointRecord& joint = record.joints[1];
      joint.dq_estimate = number == 3 ? -4.0F : 1.0F;
      joint.feedback.tau = number == 6 ? 7.5F : -2.0F;
      joint.feedback.temperature_C = number == 2 ? 61.0F : 40.0F;
      joint.kp_command = number == 10 ? 0.0F : 80.0F;
      joint.kd_command = number == 10 ? 3.0F : 1.0F;
    });
  }
  const evidence::SampleBlock block = builder_.finish();
  const std::pair<const char*, float> wanted[] = {{"dq1", -4}, {"tau1", 7.5}, {"temperature1", 61}, {"kp1", 0},
                                                  {"kd1", 3},  {"tau0", 0},   {"temperature0", 0}};
  for (const auto& [name, value] : wanted) EXPECT_FLOAT_EQ(column(block, name)[0], value) << name;
}

// Interventions of all joints and ticks are joined; a bus shows its worst state and the errors of the bucket alone.
TEST_F(SampleBlockTest, MasksAreJoinedAndCountersBecomeDifferences) {
  for (std::uint64_t number = 1; number <= 20; ++number) {
    tick(number, 1, [&](TickRecord& record) {
      if (number == 2) record.joints[0].interventions = bit(Intervention::velocity_limit);
      if (number == 5) record.joints[1].interventions = bit(Intervention::torque_limit);
      record.header.buses[0].tx_dropped = 100 + (number >= 15 ? 3U : 0U);
      record.header.buses[0].foreign_frames = number >= 16 ? 1 : 0;
      record.header.buses[0].state = number == 12 ? BusState::error_passive : BusState::up;
    });
  }
  const evidence::SampleBlock block = builder_.finish();
  EXPECT_EQ(column(block, "interventions")[0],
            static_cast<float>(bit(Intervention::velocity_limit) | bit(Intervention::torque_limit)));
  EXPECT_EQ(column(block, "interventions")[1], 0.0F);
  EXPECT_EQ(column(block, "bus0.errors")[0], 0.0F) << "counters run since start, not since the first tick";
  EXPECT_EQ(column(block, "bus0.errors")[1], 4.0F);
  EXPECT_EQ(column(block, "bus0.state")[0], 0.0F);
  EXPECT_EQ(column(block, "bus0.state")[1], static_cast<float>(BusState::error_passive));
}

TEST_F(SampleBlockTest, WhatDoesNotExistIsNotDrawn) {
  tick(1, 1, [](TickRecord& record) { record.header.seats[Seat::policy].freshness = Freshness::missing; });
  const std::vector<float> target{0.5F, -0.5F};
  context_.policy_target = target;
  tick(2, 1);
  tick(40, 1);  // ticks between were lost
  const evidence::SampleBlock block = builder_.finish();
  ASSERT_EQ(block.rows(), 3U);
  EXPECT_FLOAT_EQ(column(block, "age")[0], 1) << "of the bucket's second tick";
  EXPECT_TRUE(std::isnan(column(block, "target0")[0])) << "no command at the bucket's beginning";
  EXPECT_TRUE(std::isnan(column(block, "age")[1])) << "a gap breaks the line";
  EXPECT_TRUE(std::isnan(column(block, "q0")[1]));
  EXPECT_FLOAT_EQ(column(block, "target1")[2], -0.5);
}

// What was true of the last tick before a gap is not stretched to the gap's end.
TEST_F(SampleBlockTest, AGapBeginsAPeriodBehindTheLastTickBeforeIt) {
  for (std::uint64_t number = 1; number <= 13; ++number) tick(number, 1);
  tick(500, 1);
  const evidence::SampleBlock block = builder_.finish();
  ASSERT_EQ(block.rows(), 4U);
  EXPECT_DOUBLE_EQ(block.at_s[1], 0.011);
  EXPECT_DOUBLE_EQ(block.at_s[2], 0.014);
  EXPECT_DOUBLE_EQ(block.at_s[3], 0.5);
  for (const evidence::SampleColumn& each : block.columns) EXPECT_TRUE(std::isnan(each.values[2])) << each.name;
}

TEST_F(SampleBlockTest, TicksLeftOutOnPurposeAreNoGap) {
  tick(1, 1);
  builder_.pause();
  tick(500, 2);
  const evidence::SampleBlock block = builder_.finish();
  ASSERT_EQ(block.rows(), 2U);
  EXPECT_FLOAT_EQ(column(block, "age")[0], 1);
  EXPECT_FLOAT_EQ(column(block, "age")[1], 2);
}

}  // namespace
}  // namespace takt::monitor
