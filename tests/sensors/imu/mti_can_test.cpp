// SPDX-License-Identifier: Apache-2.0
// Goal: four frames of an MTi are one sample, as old as the oldest of them, and what lacks one, is a stranger's or says
// that down is up is none. Method: frames written byte by byte from the description of the protocol; groups with holes.
#include "sensors/imu/mti_can.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "tests/sensors/imu/mti_can_encoder.hpp"

namespace takt::sensors {
namespace {

using test::mti_frame;
using test::mti_group;

const MtCanIds kIds = parse_mt_can_ids("0x006,0x021,0x032,0x034").value();

drivers::ReceivedFrame at(std::int64_t us, const drivers::CanFrame& frame) {
  return {frame, MonoTime{us * 1000}};
}

TEST(MtCan, FourFramesAreASample) {
  MtCanGroups groups(kIds);
  // 0x0102; 0.5, -0.5, 0.5, -0.5; 1, -2, 0.5 rad/s; 0, -1, 9.8125 m/s2
  EXPECT_FALSE(groups.take(at(10, mti_frame(0x006, {0x0102}))));
  EXPECT_FALSE(groups.take(at(20, mti_frame(0x021, {0x4000, 0xC000, 0x4000, 0xC000}))));
  EXPECT_FALSE(groups.take(at(30, mti_frame(0x032, {0x0200, 0xFC00, 0x0100}))));
  const auto whole = groups.take(at(40, mti_frame(0x034, {0x0000, 0xFF00, 0x09D0})));
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->sample.counter, 0x0102);
  EXPECT_FALSE(whole->sample.ticks);
  EXPECT_EQ(whole->sample.rotation, (std::array{0.5, -0.5, 0.5, -0.5}));
  EXPECT_EQ(whole->sample.angular_velocity, (std::array{1.0, -2.0, 0.5}));
  EXPECT_EQ(whole->sample.acceleration, (std::array{0.0, -1.0, 9.8125}));
  EXPECT_EQ(whole->first_frame_at, MonoTime{10'000}) << "as old as its oldest frame";
}

TEST(MtCan, TheOldestFrameCountsWhateverTheirStampsSay) {
  MtCanGroups groups(kIds);
  const auto frames = mti_group({});
  groups.take(at(40, frames[0]));
  groups.take(at(50, frames[1]));
  groups.take(at(20, frames[2]));
  const auto whole = groups.take(at(60, frames[3]));
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->first_frame_at, MonoTime{20'000});
}

// Whichever frame is lost: that group is no sample, and the next one is whole, of its own frames alone.
TEST(MtCan, AGroupWithAHoleIsNoneAndTheNextOneIsWhole) {
  for (std::size_t lost = 0; lost < 4; ++lost) {
    MtCanGroups groups(kIds);
    std::vector<std::uint16_t> counters;
    for (std::uint16_t group = 1; group <= 3; ++group) {
      const auto frames = mti_group({.counter = group, .acceleration = {0, 0, static_cast<float>(group)}});
      for (std::size_t i = 0; i < frames.size(); ++i) {
        if (group == 2 && i == lost) continue;
        const auto whole = groups.take(at(group * 1000 + static_cast<int>(i), frames[i]));
        if (!whole) continue;
        counters.push_back(whole->sample.counter);
        EXPECT_EQ(whole->sample.acceleration[2], whole->sample.counter) << "mixed of two groups; lost " << lost;
      }
    }
    EXPECT_EQ(counters, (std::vector<std::uint16_t>{1, 3})) << "lost " << lost;
    EXPECT_EQ(groups.incomplete(), lost == 0 ? 0U : 1U) << "lost " << lost;
  }
}

TEST(MtCan, StrangersShortAndRemoteFramesAreLeftAlone) {
  MtCanGroups groups(kIds);
  const auto frames = mti_group({});
  groups.take(at(1, frames[0]));
  groups.take(at(2, frames[1]));
  groups.take(at(3, frames[2]));
  auto other = frames[3];
  other.id = 0x035;
  EXPECT_FALSE(groups.take(at(4, other)));
  other = frames[3];
  other.extended = true;
  EXPECT_FALSE(groups.take(at(5, other)));
  other = frames[3];
  other.length = 5;
  EXPECT_FALSE(groups.take(at(6, other)));
  other = frames[3];
  other.remote = true;
  EXPECT_FALSE(groups.take(at(7, other)));
  EXPECT_TRUE(groups.take(at(8, frames[3])));
}

TEST(MtCan, ItSaysWhyThereIsNoSample) {
  MtCanGroups groups(kIds);
  EXPECT_NE(groups.why_none().find("no frame of an MTi"), std::string::npos);
  const auto frames = mti_group({});
  groups.take(at(1, frames[1]));
  groups.take(at(2, frames[2]));
  EXPECT_EQ(groups.why_none(),
            "of an MTi come Quaternion (0x021), Rate of Turn (0x032); have MT Manager send Group "
            "Counter (0x006), Acceleration (0x034) too");
  groups.take(at(3, frames[3]));
  groups.take(at(4, frames[0]));
  EXPECT_NE(groups.why_none().find("no group of them is whole"), std::string::npos);
}

TEST(MtCan, IdsAreFourRisingFromTheCounters) {
  const auto ids = parse_mt_can_ids("0x100,0x121,0x7FF,0x134");
  ASSERT_TRUE(ids) << ids.error();
  EXPECT_EQ(text_of((*ids)[2]), "0x7FF");
  const auto extended = parse_mt_can_ids("0x19FF0006,0x19FF0021,0x19FF0032,0x19FF0034");
  ASSERT_TRUE(extended) << extended.error();
  EXPECT_TRUE((*extended)[0].extended);
  EXPECT_EQ(text_of((*extended)[1]), "0x19FF0021");
  for (const char* text :
       {"", "0x006", "0x006,0x021,0x032", "0x006,0x021,0x032,0x034,0x035", "0x006,0x021,0x032,", "6,33,50,52",
        "0x021,0x006,0x032,0x034", "0x006,0x021,0x021,0x034", "0x006,0x021,0x032,0x800", "0x006,0x021,0x032,0x00000034",
        "0x006,0x021,0x032,0x2FFFFFFF", "0x006,0x021,0x032,0x3g", "0x006,0x021,0x032,-0x34"})
    EXPECT_FALSE(parse_mt_can_ids(text)) << text;
}

// Goal: a part that reckons in a world whose z points down is never believed, however it lies; one with z up is, also
// while it moves.
TEST(MtCan, GravityTellsWhichWayIsUp) {
  const auto settles = [](const std::array<double, 4>& rotation, const std::array<double, 3>& force,
                          std::string* doubt) {
    GravityCheck check;
    bool settled = false;
    for (int i = 0; i < 100; ++i) {
      EXPECT_FALSE(settled) << "it takes 100 samples";
      settled = check.take({.rotation = rotation, .acceleration = force});
    }
    if (doubt != nullptr) *doubt = check.doubt();
    return settled;
  };
  std::string doubt;
  EXPECT_TRUE(settles({1, 0, 0, 0}, {0, 0, 9.81}, &doubt));
  EXPECT_EQ(doubt, "");
  EXPECT_TRUE(settles({0, 1, 0, 0}, {0, 0, -9.81}, nullptr)) << "upside down, and knows it";
  const double half = 0.70710678;
  EXPECT_TRUE(settles({half, half, 0, 0}, {0, 9.81, 0}, nullptr)) << "a quarter about x: its y is up";
  EXPECT_TRUE(settles({half, 0, half, 0}, {-9.81, 0, 0}, nullptr)) << "a quarter about y: its x is down";
  EXPECT_TRUE(settles({1, 0, 0, 0}, {6, -6, 7}, nullptr)) << "it moves";
  EXPECT_FALSE(settles({1, 0, 0, 0}, {0, 0, -9.81}, &doubt));
  EXPECT_NE(doubt.find("ENU or NWU"), std::string::npos);
  EXPECT_FALSE(settles({half, 0, half, 0}, {9.81, 0, 0}, nullptr)) << "the other way round";
  EXPECT_FALSE(settles({1, 0, 0, 0}, {9.81, 0, 0}, &doubt)) << "its rotation is wrong";
  EXPECT_NE(doubt.find("0.0 m/s2 upwards"), std::string::npos) << doubt;
}

TEST(MtCan, OnceSettledItStays) {
  GravityCheck check;
  for (int i = 0; i < 100; ++i) check.take({.rotation = {1, 0, 0, 0}, .acceleration = {0, 0, 9.81}});
  EXPECT_TRUE(check.take({.rotation = {1, 0, 0, 0}, .acceleration = {0, 0, -30}})) << "a robot lands";
}

}  // namespace
}  // namespace takt::sensors
