// SPDX-License-Identifier: Apache-2.0
// make_lerobot_set DIR: two recorded runs of the virtual robot, DIR/one and DIR/two, and DIR/set, the LeRobot data set
// of both, for readers in other languages. Its data files are small, so that there are several.
#include <cstdio>
#include <exception>
#include <stdexcept>

#include "lab/data_set/lerobot_data_set.hpp"
#include "tests/monitor/record/recorded_demo.hpp"

namespace {

takt::data_set::RunEpisodes required(std::expected<takt::data_set::RunEpisodes, std::string> episodes) {
  if (!episodes) throw std::runtime_error(episodes.error());
  return std::move(*episodes);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace takt;
  if (argc != 2) return 64;
  try {
    const std::string folder = argv[1];
    const auto one = monitor::record_demo(folder + "/one");
    monitor::VirtualRobot robot;
    robot.answer_ticks = 17;
    const auto two = monitor::record(robot, folder + "/two", 1'500, [](std::uint64_t) {});
    const std::vector runs{required(data_set::episodes_of(one)), required(data_set::episodes_of(two))};
    constexpr std::size_t kTwoEpisodes = 10'000;
    const auto written = data_set::write_lerobot(runs, "follow the \"target\"", folder + "/set", kTwoEpisodes);
    if (!written) throw std::runtime_error(written.error());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_lerobot_set: %s\n", error.what());
    return 1;
  }
  return 0;
}
