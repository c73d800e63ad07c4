// SPDX-License-Identifier: Apache-2.0
#include "simulation/world_process.hpp"

#include <fmt/format.h>
#include <stdlib.h>

#include <filesystem>
#include <utility>

#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/unix_socket.hpp"

namespace takt::simulation {
namespace {

constexpr Duration kLookAgain = milliseconds(10);

std::string with_socket(std::string command, const std::string& socket) {
  for (std::size_t at = command.find(WorldProcess::kPlace); at != std::string::npos;
       at = command.find(WorldProcess::kPlace, at + socket.size()))
    command.replace(at, WorldProcess::kPlace.size(), socket);
  return command;
}

}  // namespace

WorldProcess::WorldProcess(std::string socket_or_command) : WorldProcess(std::move(socket_or_command), Patience{}) {}

WorldProcess::WorldProcess(std::string socket_or_command, const Patience& patience)
    : text_(std::move(socket_or_command)), patience_(patience) {}

WorldProcess::~WorldProcess() {
  give_up();
}

void WorldProcess::give_up() {
  // A forked copy has not started the process that it knows of.
  if (process_.is_kept()) {
    process_.end();
    forget_folder();
  }
}

void WorldProcess::forget_folder() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

std::expected<void, WorldEnd> WorldProcess::start() {
  const auto absent = [this](const std::string& what) {
    return std::unexpected(WorldEnd{WorldEndKind::absent, fmt::format("world `{}`: {}", text_, what)});
  };
  std::string pattern = (std::filesystem::temp_directory_path() / "takt-world.XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) return absent("no folder for its socket: " + ipc::errno_text());
  folder_ = pattern;
  socket_ = folder_ + "/world.sock";
  if (const auto started = process_.start(with_socket(text_, socket_)); !started) return absent(started.error());
  for (const MonoTime deadline = monotonic_now() + patience_.start; !std::filesystem::exists(socket_);
       sleep_until(monotonic_now() + kLookAgain)) {
    if (const auto code = process_.ended()) {
      forget_folder();
      return absent(fmt::format("exited with {} before it listened; what it said is above", *code));
    }
    if (monotonic_now() < deadline) continue;
    give_up();
    return absent(fmt::format("did not listen at {} within {:.0f} s", socket_, patience_.start.seconds()));
  }
  return {};
}

std::expected<std::unique_ptr<OutsideMechanics>, WorldEnd> WorldProcess::begin(const config::RobotConfig& robot,
                                                                               std::uint64_t seed) {
  if (!is_command(text_)) return OutsideMechanics::connect(robot, text_, seed, patience_.link);
  if (!process_.is_kept()) {
    if (auto started = start(); !started) return std::unexpected(started.error());
  }
  return OutsideMechanics::connect(robot, socket_, seed, patience_.link);
}

std::expected<WorldFacts, WorldEnd> WorldProcess::ask(const config::RobotConfig& robot) {
  const auto begun = begin(robot, robot.simulation->seed);
  give_up();
  if (!begun) return std::unexpected(begun.error());
  const WorldLink& link = (*begun)->link();
  return WorldFacts{link.world(), link.gives()};
}

}  // namespace takt::simulation
