// SPDX-License-Identifier: Apache-2.0
// Speculation: a policy that is slow answers for states that are not there yet. It gives alternatives, each a chunk
// with the state that it assumes the joints in at a later instant. They wait here, in the policy's own process; what
// the robot is sent is the one whose assumption came true, or nothing.
//
//   kept      kMost at most; when one more comes the oldest goes (dropped)
//   compared  with the first observation published at or after the assumed instant: positions, and velocities where the
//             alternative assumes any, of every joint. Its distance is the largest difference, in the robot file's
//             tolerances (policy.speculation); it matches at 1 or less
//   taken     the nearest that matches. It answers that observation: its path is read from there on, so that each of
//             its targets stays at the instant that it was meant for. Its age still counts from the oldest sample that
//             it rests on. The others are outdone or unmatched, and gone
//   dropped   never compared: its observation was missed, it is older than max_age, an answer to a newer observation
//             went out, or the policy was told to forget
//
// Nothing allocates after construction. Thread rule: one thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "client/takt/client.h"
#include "config/robot_config.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/observation.hpp"

namespace takt::client {

class Alternatives {
 public:
  static constexpr std::size_t kMost = 8;

  // Precondition: robot.policy. Without policy.speculation none may be kept.
  explicit Alternatives(const config::RobotConfig& robot);

  // `chunk` answers the observation in its header and rests on samples no older than `sensed_at`.
  void keep(const CommandChunk& chunk, MonoTime sensed_at, const takt_assumption& assumption);
  // Compares those whose instant has come. True: `answer` has the steps of the one that is taken, its first one for the
  // instant of `observation`, and `sensed_at` is its oldest sample's. `answered`: the newest observation that an answer
  // went out to.
  bool match(const Observation& observation, std::uint64_t answered, CommandChunk& answer, MonoTime& sensed_at);
  void drop_all();

  [[nodiscard]] const takt_alternatives& counts() const { return counts_; }

 private:
  struct Kept {
    std::uint64_t order = 0;  // 0: none
    CommandHeader header;
    MonoTime at, sensed_at;
    bool has_dq = false;
    std::vector<float> values, q, dq;
  };
  void drop(Kept& one);
  [[nodiscard]] float distance(const Kept& one, const Observation& observation) const;
  void read_from(const Kept& one, MonoTime from, CommandChunk& answer) const;

  config::Interpolation interpolation_;
  Duration max_age_;
  float q_tolerance_ = 0, dq_tolerance_ = 0;  // of a radian of each joint
  std::vector<float> per_rad_;                // by joint
  std::size_t joints_;
  std::array<Kept, kMost> kept_;
  std::uint64_t order_ = 0;
  takt_alternatives counts_{};
};

}  // namespace takt::client
