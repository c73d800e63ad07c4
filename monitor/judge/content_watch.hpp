// SPDX-License-Identifier: Apache-2.0
// Content that no stamp and no age shows wrong: what the policy was shown, and what it asked for, against what came
// before.
//
//   frozen     values stay the same, bit for bit, through five samples or more with fresh stamps, and then jump by more
//              than three usual steps; an IMU's stay the same through five, as no measurement does; or an image does
//              while a joint moves by 0.05 rad or m.
//              Only of a sensor whose samples used to differ: twenty in a row.
//   mirrored   values are the opposite of the sample before, which is more than ten usual steps away; trouble by
//              itself from the third within a second on. Not of a unit quaternion, whose opposite is the same turn, nor
//              of an angle at its half turn.
//   reordered  a command's first step gives three joints or more one another's targets of the command before, or, when
//              the policy takes over, one another's measured positions; and all later ones, until they are given back.
// A step is the distance between neighbours; the usual one is a running mean of those that are none of the above.
//
// What it cannot see: values that freeze where they would have stayed, a lie from the first sample on, a wrong order
// of joints that stand alike. Thread rule: one thread at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::monitor {

// How much of it was found.
struct WrongContent {
  std::uint64_t frozen_samples = 0, mirrored_samples = 0;
  std::size_t sensor = 0;              // of the newest of these
  std::uint64_t reordered_joints = 0;  // of the newest command that was
  bool is_trouble = false;             // by itself: all but one or two mirrored samples
  void take(const WrongContent& later);
};

// Of the policy in charge.
struct WatchedContent {
  struct Sensor {
    std::string name;
    bool is_watched = true;  // false: a command that a person gives, who may hold it still
  };
  std::vector<Sensor> sensors;     // as in the robot file
  std::optional<std::size_t> imu;  // of them, which the executive reads: its samples are the ticks'
  CommandField field = CommandField::q;
};
WatchedContent watched_content_of(const config::RobotConfig& robot);

class ContentWatch {
 public:
  explicit ContentWatch(const WatchedContent& watched);
  // A sample that the policy was shown; one that was seen before is ignored.
  void sample(std::size_t sensor, std::uint64_t sequence, MonoTime sensed_at, std::span<const float> values);
  // `content`: equal for images that are equal, its hash.
  void image(std::size_t sensor, std::uint64_t sequence, MonoTime sensed_at, std::string_view content);
  // Before the tick that reads it. `values`: as CommandChunk::values, the used part.
  void command(const CommandHeader& header, std::span<const float> values);
  // What was found since the tick before. Precondition: the record is whole.
  WrongContent tick(const TickRecord& record);

 private:
  struct Sensor {
    std::uint64_t sequence = 0;  // of the newest sample, 0: none
    MonoTime sensed_at;
    std::vector<float> values;
    std::string image;
    std::uint64_t changes = 0;  // samples in a row that differed; kept through a freeze
    std::uint64_t same = 0;     // samples in a row that did not
    double usual_step = 0;
    std::vector<MonoTime> mirrored;  // within a second
    std::vector<float> q;            // of the joints, when the newest image changed
  };
  void note_sample(std::size_t sensor, std::uint64_t sequence, MonoTime sensed_at, std::span<const float> values);
  [[nodiscard]] Sensor* fresh(std::size_t sensor, std::uint64_t sequence, MonoTime sensed_at);
  void note_step(std::size_t sensor, std::span<const float> values);
  void note_mirrored(std::size_t sensor);
  void note_frozen(std::size_t sensor, std::uint64_t samples);
  [[nodiscard]] bool has_moved_since(const Sensor& sensor) const;

  WatchedContent watched_;
  std::vector<Sensor> sensors_;
  std::vector<float> q_;       // measured, at the tick before
  std::vector<float> asked_;   // the first step of the command to come; empty: none
  std::vector<float> before_;  // of the newest that was accepted, or the joints' positions
  bool before_is_measured_ = true;
  std::uint64_t reordered_ = 0;  // joints whose targets are another's; 0: none
  double usual_jump_ = 0;        // of a command's targets against the one before
  std::uint8_t session_ = 0;
  bool relied_ = false;
  WrongContent found_;
};

}  // namespace takt::monitor
