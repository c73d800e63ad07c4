// SPDX-License-Identifier: Apache-2.0
// A world for tests: a forked child that plays through takt/world.h, or as a raw socket says anything at all.
#pragma once

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wold-style-cast"
#include "client/takt/world.h"
#pragma GCC diagnostic pop

#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>

#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/support/temporary_directory.hpp"

namespace takt::test {

// Runs `body` with a socket path in a child, which never outlives this.
class ForkedWorld {
 public:
  explicit ForkedWorld(const std::function<void(const std::string&)>& body) {
    pid_ = fork();
    if (pid_ < 0) throw std::runtime_error("fork failed");
    if (pid_ != 0) return;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    body(path());
    _exit(0);
  }
  ForkedWorld(const ForkedWorld&) = delete;
  ForkedWorld& operator=(const ForkedWorld&) = delete;
  ~ForkedWorld() { kill(); }
  [[nodiscard]] std::string path() const { return folder_.path("world.sock"); }
  void kill() {
    if (pid_ > 0 && ::kill(pid_, SIGKILL) == 0) waitpid(pid_, nullptr, 0);
    pid_ = 0;
  }

 private:
  const TemporaryDirectory folder_;
  pid_t pid_ = 0;
};

// Plays one simulation; `fill` makes the answer to world.reset or world.step, false: says nothing and ends. `sensor`:
// the one that states have, of `values` values. `cameras`: whose images they have, name and shape.
inline void play(const std::string& path, std::uint32_t gives,
                 const std::function<bool(takt_world&, takt_world_state&)>& fill, const char* sensor = nullptr,
                 std::uint32_t values = 0, const std::vector<takt_world_camera>& cameras = {}) {
  takt_world world;
  if (takt_world_listen(&world, path.c_str()) != 0) return;
  world.sensor = sensor;
  world.sensor_count = values;
  for (const takt_world_camera& one : cameras)
    takt_world_add_camera(&world, one.name, one.height, one.width, one.channels);
  if (takt_world_accept(&world, "forked", gives) != 0) return;
  takt_world_state state{};
  state.orientation[0] = state.base_orientation[0] = 1;
  while (takt_world_next(&world) == 0) {
    const bool begins = world.kind == TAKT_WORLD_RESET;
    state.time_ns = begins ? 0 : world.step.time_ns + world.step.step_ns;
    if (!fill(world, state) || takt_world_answer(&world, &state) != 0) return;
  }
}

}  // namespace takt::test
