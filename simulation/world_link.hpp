// SPDX-License-Identifier: Apache-2.0
// Takt's end of the world protocol (docs/world-protocol.md): one process of the user's plays the robot's mechanics, one
// question and one answer at a time. What comes from it is copied once, then judged; a world that hangs, dies, answers
// wrongly or gives up ends the link with a WorldEnd, and every later call repeats it.
//
// Units: joint side, rad, rad/s, Nm. Each call blocks, at most Patience. Thread rule: one thread at a time.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/takt/world_messages.h"
#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/ipc/descriptor.hpp"
#include "executive/ipc/segment.hpp"
#include "simulation/sensed.hpp"

namespace takt::simulation {

enum class WorldEndKind : std::uint8_t {
  absent,          // no world listened, in all the time there was
  refused,         // it does not play this robot
  hung,            // no answer in time
  died,            // the connection closed
  invalid_answer,  // one that cannot be
  unable,          // it says that it cannot go on
  failed,          // it says that the task is beyond help
  succeeded,       // it says that the task is done
};
std::string_view name(WorldEndKind kind);

struct WorldEnd {
  WorldEndKind kind = WorldEndKind::absent;
  std::string sentence;  // which world, what, and where there is a way, how to correct it
};

// A sensor of images that a world may play.
struct WorldCamera {
  std::string name;
  config::ImageShape shape;
};

// An image that came with a state.
struct WorldImage {
  std::size_t camera = 0;  // index into Robot::cameras
  std::uint64_t sequence = 0;
  Duration sensed_at;  // since the reset
  Pixels pixels;
};

class WorldLink {
 public:
  struct Robot {
    std::string name;
    std::vector<std::string> joints;  // at most kMaxJoints; names of fewer than TAKT_WORLD_NAME_BYTES bytes
    Duration step;
    std::vector<WorldCamera> cameras{};  // at most TAKT_WORLD_MAX_CAMERAS
  };
  struct Patience {
    Duration greeting = seconds(10);  // until it listens and has welcomed us
    Duration answer = seconds(1);     // to each reset and step
  };

  // To the world that listens at `path`, a Unix stream socket.
  static std::expected<WorldLink, WorldEnd> connect(const std::string& path, const Robot& robot,
                                                    const Patience& patience);
  std::expected<takt_world_state, WorldEnd> reset(std::uint64_t seed, std::span<const double> q);
  struct Load {
    std::span<const double> torque, viscous, coulomb;  // one value per joint
    bool hangs = false;                                // a base of its own is held where it began
    std::array<double, 3> push{};                      // N
  };
  std::expected<takt_world_state, WorldEnd> step(const Load& load);

  [[nodiscard]] const std::string& world() const { return name_; }  // as it calls itself
  [[nodiscard]] bool gives(std::uint32_t what) const { return (gives_ & what) != 0; }
  [[nodiscard]] std::uint32_t gives() const { return gives_; }
  // Which of the robot's outside sensors its states have, and of how many values; empty: none.
  [[nodiscard]] const std::string& sensor() const { return sensor_; }
  [[nodiscard]] std::size_t sensor_count() const { return sensor_count_; }
  // Whose images its states have: indices into Robot::cameras.
  [[nodiscard]] std::vector<std::size_t> cameras() const;
  // Those that came with the latest answer. Valid until the next question.
  [[nodiscard]] std::span<const WorldImage> images() const { return images_; }
  [[nodiscard]] bool is_over_shared_memory() const { return gives(TAKT_WORLD_SHARED_MEMORY); }

 private:
  WorldLink(std::string path, const Robot& robot, const Patience& patience);
  std::expected<void, WorldEnd> call_on(MonoTime deadline);
  std::expected<void, WorldEnd> greet(const Robot& robot, MonoTime deadline);
  std::expected<takt_world_state, WorldEnd> ask(std::span<const std::byte> question);
  std::optional<WorldEnd> send(std::span<const std::byte> question, std::span<const int> files);
  std::optional<WorldEnd> receive_by_socket(std::span<std::byte> into, MonoTime deadline);
  std::optional<WorldEnd> receive_by_memory(std::span<std::byte> into, MonoTime deadline);
  std::optional<WorldEnd> accept_cameras(const takt_world_welcome& welcome);
  std::optional<WorldEnd> take_images(const takt_world_state& state, MonoTime deadline);
  std::optional<WorldEnd> receive_pixels(std::size_t camera, MonoTime deadline, Pixels& pixels);
  [[nodiscard]] std::string image_problem(const takt_world_image& image, Duration now) const;  // empty: none
  [[nodiscard]] std::optional<WorldEnd> judge(const takt_world_state& state) const;
  [[nodiscard]] std::string sensor_problem(const takt_world_state& state) const;  // empty: none
  [[nodiscard]] std::optional<WorldEnd> judge_outcome(const takt_world_state& state) const;
  [[nodiscard]] WorldEnd end(WorldEndKind kind, const std::string& what) const;
  [[nodiscard]] WorldEnd went_away() const;
  takt_world_header next_header(std::uint16_t kind, std::size_t bytes);

  struct CameraPlace {
    WorldCamera declared;
    std::size_t offset = 0;  // in the shared memory
    bool is_played = false;
    std::uint64_t seen = 0;  // sequence of its newest image
    Duration sensed_at{};    // of that, since the reset
  };

  std::string path_, name_, sensor_;
  Patience patience_;
  std::size_t joint_count_;
  Duration step_;
  std::uint32_t gives_ = 0;
  std::size_t sensor_count_ = 0;
  std::uint64_t seen_sample_ = 0;  // its sequence
  std::uint64_t sequence_ = 0;
  Duration time_;  // since the reset, that the next answer has to have
  ipc::Descriptor socket_;
  std::optional<ipc::Segment> memory_;
  std::vector<CameraPlace> cameras_;
  std::vector<WorldImage> images_;
  std::optional<WorldEnd> ended_;
};

}  // namespace takt::simulation
