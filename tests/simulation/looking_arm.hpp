// SPDX-License-Identifier: Apache-2.0
// The demo arm under the policy that looks (docs/examples/python-sensor/look.onnx), and a world that stands still and
// shows it a spot: what the network is shown follows from the image alone.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <string>

#include "executive/contract/mono_time.hpp"
#include "tests/simulation/forked_world.hpp"
#include "tests/support/files.hpp"

namespace takt::test {

inline constexpr std::size_t kImageHeight = 48, kImageWidth = 64, kSpot = 8;

namespace detail {

inline void put(std::string& text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::runtime_error("no `" + from + "` in the robot file");
  text.replace(at, from.size(), to);
}

inline void drop_line(std::string& text, const std::string& with) {
  const std::size_t at = text.find(with);
  if (at == std::string::npos) throw std::runtime_error("no `" + with + "` in the robot file");
  const std::size_t begin = text.rfind('\n', at);
  text.erase(begin, text.find('\n', at) - begin);
}

}  // namespace detail

// A robot file in that directory: the demo arm with a camera, shown its joints and the newest image.
inline std::string looking_arm(const std::string& directory) {
  std::string text = text_of("config/arm6.yaml");
  detail::put(text, "file: arm6_reach.onnx",
              "file: " + std::filesystem::absolute("docs/examples/python-sensor/look.onnx").string() +
                  "\n  engine: { name: builtin }");
  detail::put(text, "input: obs", "input: \"obs,image\"");
  detail::drop_line(text, "term: joint_velocity");
  detail::drop_line(text, "term: last_action");
  detail::put(text, "{ term: sensor, sensor: target, scale: 1, history: 2 }", "{ term: sensor, sensor: cam0 }");
  detail::put(text, "\nsensors:\n",
              "\nsensors:\n  - { name: cam0, image: { height: 48, width: 64, channels: 1 }, timeout: 500 ms }\n");
  detail::put(text, "max_age: 150 ms", "max_age: 400 ms");
  detail::put(text, "stop_after: 600 ms", "stop_after: 900 ms");
  std::string path = directory + "/looking.yaml";
  std::ofstream(path) << text;
  return path;
}

// A bright spot on a dark ground, from that column on.
inline void draw_spot(std::uint8_t* pixels, std::size_t column) {
  std::fill_n(pixels, kImageHeight * kImageWidth, std::uint8_t{16});
  for (std::size_t row = 20; row < 20 + kSpot; ++row)
    std::fill_n(pixels + row * kImageWidth + column, kSpot, std::uint8_t{240});
}

inline constexpr Duration kImageEvery = milliseconds(33), kImageAge = milliseconds(20);
inline constexpr std::size_t kPlaces = 8;  // of the spot, one after the other, again and again

// One simulation after the other, for ever. `spoil` has the last word on every state that has an image.
inline void play_spots(const std::string& path, std::uint32_t gives,
                       const std::function<void(takt_world&, takt_world_state&)>& spoil = {}) {
  takt_world world;
  if (takt_world_listen(&world, path.c_str()) != 0) return;
  const int camera = takt_world_add_camera(&world, "cam0", kImageHeight, kImageWidth, 1);
  while (takt_world_accept(&world, "spots", gives) == 0) {
    takt_world_state state{};
    std::size_t images = 0;
    while (takt_world_next(&world) == 0) {
      if (world.kind == TAKT_WORLD_RESET) {
        state = {};
        std::copy_n(world.reset.q, TAKT_WORLD_MAX_JOINTS, state.q);
        images = world.reset.seed % kPlaces;
      } else {
        state.time_ns = world.step.time_ns + world.step.step_ns;
      }
      const auto age = static_cast<std::uint64_t>(kImageAge.ns);
      if (state.time_ns >= age && (state.time_ns - age) % static_cast<std::uint64_t>(kImageEvery.ns) == 0) {
        draw_spot(takt_world_pixels(&world, camera), 4 + 6 * (images++ % kPlaces));
        takt_world_show(&world, camera, state.time_ns - age);
        if (spoil) spoil(world, state);
      }
      if (takt_world_answer(&world, &state) != 0) break;
    }
  }
}

}  // namespace takt::test
