// SPDX-License-Identifier: Apache-2.0
// A world for one simulation after the other, as panels need them: either one that listens already, or a command that
// starts it. A command's process is started when it is first needed, serves every simulation, and is ended by give_up()
// or with this object, all its group with it; the next begin() starts it anew.
//
// Thread rule: one thread at a time. A copy of this object in a forked child starts a process of its own.
#pragma once

#include <cstdint>
#include <expected>
#include <memory>
#include <string>
#include <string_view>

#include "config/robot_config.hpp"
#include "simulation/kept_process.hpp"
#include "simulation/outside_mechanics.hpp"

namespace takt::simulation {

// What a world says of itself before it plays.
struct WorldFacts {
  std::string name;
  std::uint32_t gives = 0;  // bits of takt/world_messages.h
};

class WorldProcess {
 public:
  struct Patience {
    Duration start = seconds(120);  // of a command's process, until it listens: a simulator loads
    // No process waits in real time: a world may take as long for a step as a picture takes to render.
    WorldLink::Patience link{seconds(10), seconds(10)};
  };

  // The path of a world's socket, or a command with kPlace where that goes, for /bin/sh. Its output goes to stderr.
  explicit WorldProcess(std::string socket_or_command);
  WorldProcess(std::string socket_or_command, const Patience& patience);
  WorldProcess(const WorldProcess&) = delete;
  WorldProcess& operator=(const WorldProcess&) = delete;
  ~WorldProcess();

  static constexpr std::string_view kPlace = "{}";
  static bool is_command(std::string_view text) { return text.find(kPlace) != std::string_view::npos; }

  // The next simulation, reset with `seed`. After an error, give_up() is called for.
  std::expected<std::unique_ptr<OutsideMechanics>, WorldEnd> begin(const config::RobotConfig& robot,
                                                                   std::uint64_t seed);
  // Whether it plays this robot, and what it gives: a simulation that is reset and ended. A command's process is ended.
  std::expected<WorldFacts, WorldEnd> ask(const config::RobotConfig& robot);
  // What it plays it plays badly: a command's process is ended. One that listens already is left alone.
  void give_up();

 private:
  std::expected<void, WorldEnd> start();
  void forget_folder();

  std::string text_;
  Patience patience_;
  std::string folder_, socket_;  // of a command's process
  KeptProcess process_;
};

}  // namespace takt::simulation
