// SPDX-License-Identifier: Apache-2.0
// Goal: in virtual time a policy that looks is shown the world's images byte for byte, each as old as the world says;
// what troubles sensors troubles images; the same seed is the same rollout; without images there is one line and no
// row. Method: the demo arm under docs/examples/python-sensor/look.onnx in a world that stands still and shows it a
// spot, in a forked child; a policy in front of the network keeps what it is shown.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "evidence/rollout/rollout.hpp"
#include "policy_host/onnx_policy.hpp"
#include "tests/simulation/looking_arm.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::lab {
namespace {

using takt::test::ForkedWorld;
using takt::test::kImageAge;
using takt::test::kImageEvery;
using takt::test::play_spots;
using testing::HasSubstr;
constexpr simulation::WorldProcess::Patience kPatience{seconds(60), {seconds(60), seconds(60)}};
constexpr std::size_t kPixels = takt::test::kImageHeight * takt::test::kImageWidth;

class Watched final : public policy_host::Policy {
 public:
  explicit Watched(policy_host::Policy& inner) : inner_(inner) {}
  [[nodiscard]] std::size_t input_size() const override { return inner_.input_size(); }
  [[nodiscard]] std::size_t output_size() const override { return inner_.output_size(); }
  void infer(std::span<const float> input, std::span<float> output) override {
    shown.emplace_back(input.last(kPixels).begin(), input.last(kPixels).end());
    inner_.infer(input, output);
  }
  void reset() override { inner_.reset(); }
  std::vector<std::vector<float>> shown;  // images, in their order

 private:
  policy_host::Policy& inner_;
};

// What the network is to be shown of the spot at that place.
std::vector<float> image_of(std::size_t place) {
  std::vector<std::uint8_t> pixels(kPixels);
  takt::test::draw_spot(pixels.data(), 4 + 6 * place);
  std::vector<float> shown(kPixels);
  std::ranges::transform(pixels, shown.begin(), [](std::uint8_t byte) { return static_cast<float>(byte) / 255; });
  return shown;
}

struct Rolled {
  evidence::RolloutRow row;
  std::string problem, end;                         // empty: there is a row
  std::vector<std::vector<float>> shown;            // to the network
  std::vector<std::pair<MonoTime, Duration>> ages;  // of the images behind each command: when it was taken up, how old
};

class VisionRollout : public testing::Test {
 protected:
  VisionRollout() {
    robot_ = config::load(takt::test::looking_arm(folder_.path())).value();
    policy_ = policy_host::load_onnx_policy(robot_.policy->file, robot_.policy->input, robot_.policy->output).value();
  }

  Rolled roll(evidence::WorldProcess* world, std::string_view trouble = "none", double dose = 0,
              std::uint64_t seed = 1) {
    Rolled rolled;
    Watched watched(*policy_);
    const evidence::RolloutSetup setup{
        .robot = robot_,
        .policy = watched,
        .policy_hash = 1,
        .task = evidence::Task::world,
        .timing = {},
        .perturbation = {evidence::find_perturbation(trouble)->as<evidence::Trouble>(), dose, seconds(2), seconds(2)},
        .seed = seed,
        .duration = seconds(5),
        .scored = seconds(1),
        .bound_m = 1,
        .on_command =
            [&](const CommandChunk& chunk) {
              const CommandHeader& header = chunk.header;
              rolled.ages.emplace_back(header.dequeued_at, header.dequeued_at - header.outside_sensed_at);
            },
        .world = world,
        .on_world_end = [&](const simulation::WorldEnd& end) { rolled.end = end.sentence; }};
    if (const auto done = evidence::run_rollout(setup, rolled.row); !done) rolled.problem = done.error();
    rolled.shown = std::move(watched.shown);
    return rolled;
  }

  config::RobotConfig robot_;
  std::unique_ptr<policy_host::Policy> policy_;

 private:
  const test::TemporaryDirectory folder_;
};

// Of images under commands that were begun while the perturbation acted, or, of the nominal rollout, would have.
std::pair<Duration, Duration> youngest_and_oldest(const Rolled& rolled) {
  const MonoTime first = rolled.ages.front().first;
  Duration youngest = seconds(100), oldest;
  for (const auto& [at, age] : rolled.ages) {
    if (at - first < milliseconds(2200) || at - first > milliseconds(3800)) continue;
    youngest = std::min(youngest, age);
    oldest = std::max(oldest, age);
  }
  return {youngest, oldest};
}

TEST_F(VisionRollout, TheNetworkIsShownEveryImageAsOldAsItIs) {
  const ForkedWorld process([](const std::string& path) { play_spots(path, TAKT_WORLD_ERROR); });
  evidence::WorldProcess world(process.path(), kPatience);
  const Rolled rolled = roll(&world);
  ASSERT_EQ(rolled.problem, "");
  EXPECT_TRUE(rolled.row.success) << rolled.row.failure_label;
  ASSERT_GT(rolled.shown.size(), 200U) << "50 a second";
  // Each image for one or two observations of 20 ms, and the next after it.
  std::size_t place = 1;  // seed 1
  for (const auto& image : rolled.shown) {
    if (image != image_of(place % takt::test::kPlaces)) ++place;
    ASSERT_EQ(image, image_of(place % takt::test::kPlaces)) << place;
  }
  EXPECT_GT(place, 130U) << "30 a second";
  const auto [youngest, oldest] = youngest_and_oldest(rolled);
  EXPECT_GE(youngest, kImageAge) << "its age at the shutter counts";
  EXPECT_LE(oldest, kImageAge + kImageEvery + milliseconds(2));
}

TEST_F(VisionRollout, TheSameSeedIsTheSameRolloutAndAnotherAnother) {
  const ForkedWorld process([](const std::string& path) { play_spots(path, TAKT_WORLD_ERROR); });
  evidence::WorldProcess world(process.path(), kPatience);
  const Rolled once = roll(&world, "sensor_dropout", 0.5, 3), again = roll(&world, "sensor_dropout", 0.5, 3);
  const Rolled other = roll(&world, "sensor_dropout", 0.5, 4);
  EXPECT_EQ(once.row.replay_hash, again.row.replay_hash);
  EXPECT_EQ(once.shown, again.shown);
  EXPECT_NE(once.row.replay_hash, other.row.replay_hash);
}

TEST_F(VisionRollout, WhatTroublesSensorsTroublesImages) {
  const ForkedWorld process([](const std::string& path) { play_spots(path, TAKT_WORLD_ERROR); });
  evidence::WorldProcess world(process.path(), kPatience);
  const Rolled nominal = roll(&world), burst = roll(&world, "sensor_burst", 200),
               dropout = roll(&world, "sensor_dropout", 0.7), frozen = roll(&world, "camera_freeze", 1000);
  const Duration most = youngest_and_oldest(nominal).second;
  EXPECT_GT(youngest_and_oldest(burst).second, most + milliseconds(100)) << "held back";
  EXPECT_GT(youngest_and_oldest(dropout).second, most + kImageEvery - milliseconds(2)) << "lost";
  EXPECT_EQ(youngest_and_oldest(frozen).second, most) << "under fresh stamps";
  // Frozen for two seconds of 50 observations each, which see the same.
  std::map<std::vector<float>, std::size_t> seen, seen_frozen;
  for (const auto& image : nominal.shown) ++seen[image];
  for (const auto& image : frozen.shown) ++seen_frozen[image];
  const auto more = [](const auto& a, const auto& b) { return a.second < b.second; };
  EXPECT_GT(std::ranges::max_element(seen_frozen, more)->second, std::ranges::max_element(seen, more)->second + 60);
}

TEST_F(VisionRollout, WhereNobodyShowsItImagesThereIsOneLineAndNoRow) {
  EXPECT_THAT(
      roll(nullptr).problem,
      HasSubstr("its policy sees images of cam0, which are not rendered in virtual time: give it a world that does"));
  const ForkedWorld process([](const std::string& path) {
    takt::test::play(path, TAKT_WORLD_ERROR, [](const takt_world&, takt_world_state&) { return true; });
  });
  evidence::WorldProcess world(process.path(), kPatience);
  EXPECT_THAT(roll(&world).problem, HasSubstr("its policy sees images of cam0, which world forked does not give"));
}

TEST_F(VisionRollout, AnImageFromTheFutureEndsItAsNonsense) {
  const ForkedWorld process([](const std::string& path) {
    play_spots(path, TAKT_WORLD_ERROR, [](takt_world& world, takt_world_state& state) {
      if (state.time_ns > 3'000'000'000) world.to_show[0].time_ns = state.time_ns + 1;
    });
  });
  evidence::WorldProcess world(process.path(), kPatience);
  const Rolled rolled = roll(&world);
  ASSERT_EQ(rolled.problem, "");
  EXPECT_EQ(rolled.row.failure_label, "world_nonsense");
  EXPECT_THAT(rolled.end, HasSubstr("an image of sensor cam0 sensed at"));
}

}  // namespace
}  // namespace takt::lab
