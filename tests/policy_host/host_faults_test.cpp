// SPDX-License-Identifier: Apache-2.0
// Goal: a policy host does wrong what its command line says, in its window and nowhere else, drawn from the seed, and
// refuses what it does not understand. Method: tables for the grammar; observations and commands in virtual time.
#include "policy_host/host_faults.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "executive/contract/mode.hpp"

namespace takt::policy_host {
namespace {

constexpr MonoTime kStart{1'000'000'000};

HostFaults faults_of(const std::string& line, std::uint64_t seed = 1) {
  auto windows = parse_host_faults(std::array{line});
  EXPECT_TRUE(windows.has_value()) << windows.error();
  HostFaults faults(std::move(*windows), seed);
  Observation observation;
  observation.published_at = kStart - seconds(5);
  observation.mode = static_cast<std::uint8_t>(Mode::standby);
  faults.see(observation);
  observation.published_at = kStart;
  observation.mode = static_cast<std::uint8_t>(Mode::tracking);
  faults.see(observation);
  return faults;
}

CommandChunk command() {
  CommandChunk chunk;
  chunk.header.joint_count = 3;
  chunk.header.step_count = 4;
  chunk.header.fields = static_cast<std::uint8_t>(CommandField::q);
  for (std::size_t i = 0; i < 12; ++i) chunk.values[i] = static_cast<float>(i % 3);  // by joint
  return chunk;
}

std::span<const float> values_of(const CommandChunk& chunk) {
  return std::span(chunk.values).first(12);
}

TEST(HostFaults, RefusesWhatItDoesNotUnderstand) {
  for (const char* line :
       {"", "3 s for 2 s", "3 s for 2 s: nap 1", "3 for 2 s: queue_growth 150", "3 s of 2 s: queue_growth 150",
        "3 s for 2 s: queue_growth", "3 s for 2 s: queue_growth 201", "3 s for 2 s: publish_delay 100",
        "3 s for 2 s: bad_actions_nan 1.5", "3 s for 2 s: wrong_joint_order 1 2", "-3 s for 2 s: queue_growth 1"}) {
    const auto windows = parse_host_faults(std::array{std::string(line)});
    ASSERT_FALSE(windows.has_value()) << line;
    EXPECT_EQ(windows.error().find("--fault '" + std::string(line) + "': "), 0U) << windows.error();
  }
}

TEST(HostFaults, ActsInsideItsWindowOnlyCountedFromTracking) {
  const HostFaults faults = faults_of("3 s for 2 s: publish_delay 100 ms");
  EXPECT_EQ(faults.publish_delay(kStart + milliseconds(2999)).ns, 0);
  EXPECT_EQ(faults.publish_delay(kStart + seconds(3)), milliseconds(100));
  EXPECT_EQ(faults.publish_delay(kStart + milliseconds(4999)), milliseconds(100));
  EXPECT_EQ(faults.publish_delay(kStart + seconds(5)).ns, 0);
  HostFaults before({{seconds(0), seconds(9), HostFault::publish_delay, 1e6}}, 1);
  EXPECT_EQ(before.publish_delay(kStart).ns, 0) << "never in tracking yet";
}

TEST(HostFaults, CallbacksComeOncePerSecondOfTheWindow) {
  HostFaults faults = faults_of("500 ms for 2 s: queue_growth 150");
  EXPECT_EQ(faults.take_callbacks(kStart + milliseconds(400)).ns, 0);
  EXPECT_EQ(faults.take_callbacks(kStart + milliseconds(510)), milliseconds(300));
  EXPECT_EQ(faults.take_callbacks(kStart + milliseconds(1400)).ns, 0);
  EXPECT_EQ(faults.take_callbacks(kStart + milliseconds(1520)), milliseconds(300));
  EXPECT_TRUE(faults.keeps_all(kStart + milliseconds(1520)));
  EXPECT_FALSE(faults.keeps_all(kStart + milliseconds(2510)));
}

TEST(HostFaults, SpoilsTheShareItWasToldTo) {
  HostFaults faults = faults_of("0 s for 10 s: bad_actions_nan 0.5");
  int spoilt = 0;
  for (int i = 0; i < 1000; ++i) {
    CommandChunk chunk = command();
    faults.spoil(chunk, kStart + seconds(1));
    spoilt += std::ranges::count_if(values_of(chunk), [](float value) { return std::isnan(value); }) == 1 ? 1 : 0;
  }
  EXPECT_NEAR(spoilt, 500, 60);
}

TEST(HostFaults, FarOffAndWrongJoints) {
  CommandChunk chunk = command();
  faults_of("0 s for 10 s: bad_actions_range 1").spoil(chunk, kStart + seconds(1));
  EXPECT_EQ(std::ranges::count_if(values_of(chunk), [](float value) { return value >= 10; }), 1);
  chunk = command();
  faults_of("0 s for 10 s: wrong_joint_order 1").spoil(chunk, kStart + seconds(1));
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(chunk.values[i], static_cast<float>((i + 2) % 3)) << i;
  chunk = command();
  faults_of("0 s for 10 s: wrong_joint_order 1").spoil(chunk, kStart + seconds(11));
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(chunk.values[i], static_cast<float>(i % 3)) << "outside its window";
}

TEST(HostFaults, TheSameSeedSpoilsTheSameCommands) {
  const auto spoilt_by = [](std::uint64_t seed) {
    HostFaults faults = faults_of("0 s for 10 s: bad_actions_range 0.5", seed);
    std::vector<float> values;
    for (int i = 0; i < 50; ++i) {
      CommandChunk chunk = command();
      faults.spoil(chunk, kStart + seconds(1));
      values.insert(values.end(), chunk.values, chunk.values + 12);
    }
    return values;
  };
  EXPECT_EQ(spoilt_by(1), spoilt_by(1));
  EXPECT_NE(spoilt_by(1), spoilt_by(2));
}

}  // namespace
}  // namespace takt::policy_host
