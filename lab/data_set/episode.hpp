// SPDX-License-Identifier: Apache-2.0
// What a run holds for training: the stretches in which the robot followed its policy, frame by frame at the policy's
// rate.
//
// A frame is an observation that was published while the robot tracked its policy. Its state is what the policy was
// given then: q (rad) of every joint, then dq (rad/s) of every joint. Its action is what the policy asked for at that
// instant: the step being played of the command in use, as the policy sent it, before joins and limits; rad, rad/s or
// Nm by policy.action.kind, of every joint but passive ones. Of a slide all of it is in m, m/s and N.
//
// An episode ends with the first tick in which something else moved the robot (standby, degraded mode, a stop, the
// fallback policy), with a tick or command that is not in the recording, where another policy took charge, and where
// the next observation came more than half a period early or late. Errors are one sentence.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <vector>

#include "monitor/record/recorded_run.hpp"

namespace takt::data_set {

// What all frames of one data set have in common.
struct Robot {
  std::string name;
  std::vector<std::string> joints, acting_joints;
  Duration period;  // between frames
  config::ActionKind action = config::ActionKind::joint_position;
  std::vector<std::string> slides{};  // of `joints`
};

struct Episode {
  std::uint64_t policy = 0;  // hash of the policy whose commands moved the robot: its leading 64 bits
  std::uint64_t first_tick = 0, last_tick = 0;  // in which its first and its last observation were published
  std::size_t frames = 0;
  std::vector<float> states;   // frames x 2 joints
  std::vector<float> actions;  // frames x acting joints
};

struct RunEpisodes {
  std::string run_id, config_sha256;
  std::string policy_sha256;  // of the run's own policy: the one in its place is known by Episode::policy alone
  Robot robot;
  std::uint64_t observations = 0;  // published in the run, in an episode or not
  std::uint64_t unreadable = 0;    // damaged chunks and messages, and a cut-off end
  std::vector<Episode> episodes;   // one at least
};
std::expected<RunEpisodes, std::string> episodes_of(const monitor::RecordedRun& run);

// Why frames of both cannot stand in one data set, as "one is of robot arm6, the other of arm7"; empty: they can.
std::string difference(const Robot& one, const Robot& other);

}  // namespace takt::data_set
