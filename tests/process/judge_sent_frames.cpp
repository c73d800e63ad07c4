// SPDX-License-Identifier: Apache-2.0
// judge_sent_frames RUN: what sent_frames.hpp says of a run folder, for tests that are not in C++.
// Exit codes: 0 every frame was inside the robot's envelope, 1 one was not, or none asked a drive for anything.
#include <cstdio>
#include <string>

#include "config/load.hpp"
#include "tests/process/sent_frames.hpp"

int main(int argc, char** argv) {
  if (argc != 2) return 1;
  const std::string run = argv[1];
  const auto robot = takt::config::load(run + "/config.yaml");
  if (!robot) {
    std::puts(robot.error().c_str());
    return 1;
  }
  const auto frames = takt::test::judge_sent_frames(run, *robot);
  std::printf("%zu frames to the drives, %s\n", frames.motion_commands,
              frames.first_violation.empty() ? "all inside the envelope" : frames.first_violation.c_str());
  return frames.motion_commands > 1000 && frames.first_violation.empty() ? 0 : 1;
}
