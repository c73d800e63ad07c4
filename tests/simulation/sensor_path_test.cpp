// SPDX-License-Identifier: Apache-2.0
// Goal: samples pass as they are, or are lost, frozen, held back or turned round as a fault says. Method: a sample
// every 10 ms of virtual time; what is delivered, and when, is compared.
#include "simulation/sensor_path.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

namespace takt::simulation {
namespace {

constexpr MonoTime kStart{1'000'000'000};

SensorSample sample(int number) {
  SensorSample made;
  made.sequence = static_cast<std::uint64_t>(number);
  made.published_at = kStart + milliseconds(10) * number;
  made.value_count = 1;
  made.values[0] = static_cast<float>(number);
  return made;
}

std::vector<float> delivered(SensorPath& path, MonoTime now) {
  std::vector<float> values;
  while (const auto one = path.deliver(now)) values.push_back(one->sample.values[0]);
  return values;
}

TEST(SensorPath, PassesEverySampleAtOnce) {
  SensorPath path(1);
  for (int i = 1; i <= 5; ++i) {
    path.take({sample(i)}, {});
    EXPECT_EQ(delivered(path, sample(i).published_at), std::vector<float>{static_cast<float>(i)});
  }
}

TEST(SensorPath, ABurstDeliversTogetherAndInOrder) {
  SensorPath path(1);
  const SensorFaults bursts{.burst = milliseconds(30), .burst_since = kStart};
  for (int i = 1; i <= 2; ++i) {
    path.take({sample(i)}, bursts);
    EXPECT_TRUE(delivered(path, sample(i).published_at).empty());
  }
  EXPECT_EQ(delivered(path, kStart + milliseconds(30)), (std::vector<float>{1, 2}));
}

TEST(SensorPath, AFrozenCameraRepeatsUnderFreshStamps) {
  SensorPath path(1);
  path.take({sample(1)}, {.frozen = true});
  path.take({sample(2)}, {});
  path.take({sample(3)}, {.frozen = true});
  path.take({sample(4)}, {});
  EXPECT_EQ(path.deliver(sample(9).published_at)->sample.values[0], 1) << "nothing to repeat yet";
  EXPECT_EQ(path.deliver(sample(9).published_at)->sample.values[0], 2);
  const auto frozen = path.deliver(sample(9).published_at);
  EXPECT_EQ(frozen->sample.values[0], 2);
  EXPECT_EQ(frozen->sample.sequence, 3U);
  EXPECT_EQ(frozen->sample.published_at, sample(3).published_at);
  EXPECT_EQ(path.deliver(sample(9).published_at)->sample.values[0], 4);
}

TEST(SensorPath, ALieIsTheOppositeUnderTheSameStamps) {
  SensorPath path(1);
  path.take({sample(1), std::make_shared<std::vector<std::uint8_t>>(4, std::uint8_t{10})}, {.lies = 1});
  path.take({sample(2), {}}, {.lies = 1, .frozen = true});
  const auto lie = path.deliver(sample(9).published_at);
  ASSERT_TRUE(lie);
  EXPECT_EQ(lie->sample.values[0], -1);
  EXPECT_EQ(lie->sample.sensed_at, sample(1).sensed_at);
  EXPECT_EQ(*lie->pixels, std::vector<std::uint8_t>(4, 245));
  EXPECT_EQ(path.deliver(sample(9).published_at)->sample.values[0], -1) << "what is frozen is what was sensed";
}

TEST(SensorPath, SomeLieByTheSeed) {
  const auto lies = [](std::uint64_t seed) {
    SensorPath path(seed);
    std::vector<bool> lied;
    for (int i = 1; i <= 1000; ++i) {
      path.take({sample(i)}, {.lies = 0.3});
      lied.push_back(path.deliver(sample(i).published_at)->sample.values[0] < 0);
    }
    return lied;
  };
  EXPECT_NEAR(static_cast<double>(std::ranges::count(lies(1), true)), 300, 60);
  EXPECT_EQ(lies(1), lies(1));
  EXPECT_NE(lies(1), lies(2));
}

TEST(SensorPath, AFrozenCameraRepeatsTheImage) {
  SensorPath path(1);
  const auto image = [](std::uint8_t grey) { return std::make_shared<std::vector<std::uint8_t>>(4, grey); };
  path.take({sample(1), image(10)}, {});
  path.take({sample(2), image(20)}, {.frozen = true});
  path.take({sample(3), image(30)}, {});
  for (const auto& [sequence, grey] : std::vector<std::pair<std::uint64_t, int>>{{1, 10}, {2, 10}, {3, 30}}) {
    const auto arrived = path.deliver(sample(9).published_at);
    ASSERT_TRUE(arrived);
    EXPECT_EQ(arrived->sample.sequence, sequence);
    EXPECT_EQ(arrived->pixels->front(), grey);
  }
}

TEST(SensorPath, LosesTheShareOfItsSeed) {
  const auto kept_by = [](std::uint64_t seed) {
    SensorPath path(seed);
    for (int i = 1; i <= 1000; ++i) path.take({sample(i)}, {.drop = 0.7});
    return delivered(path, sample(2000).published_at);
  };
  EXPECT_NEAR(static_cast<double>(kept_by(1).size()), 300, 50);
  EXPECT_EQ(kept_by(1), kept_by(1));
  EXPECT_NE(kept_by(1), kept_by(2));
}

}  // namespace
}  // namespace takt::simulation
