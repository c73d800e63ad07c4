// SPDX-License-Identifier: Apache-2.0
#include "cli/robot/executive_guard.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <optional>

#include "config/paths.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/unix_socket.hpp"

namespace takt::cli {
namespace {

constexpr auto kExecutiveAnswersWithin = std::chrono::milliseconds(500);

using Answer = std::expected<OperatorReply, std::string>;

// Nothing where none listens, or where we may not even look: that is another user's, whose buses are claimed.
std::optional<Answer> ask_status(const std::string& runtime_directory) {
  if (access(runtime_directory.c_str(), X_OK) != 0) return std::nullopt;
  const std::string socket = config::executive_socket(runtime_directory);
  if (!ipc::may_listen(socket)) return std::nullopt;
  Answer answer = ipc::ask(socket, OperatorVerb::status, kExecutiveAnswersWithin);
  if (!answer && !ipc::may_listen(socket)) return std::nullopt;  // it ended meanwhile
  return answer;
}

std::unexpected<Refusal> not_alone(std::string sentence) {
  return std::unexpected(Refusal{kExitFailed, std::move(sentence)});
}

}  // namespace

std::expected<void, Refusal> require_no_executive(const std::vector<std::string>& runtime_directories) {
  for (const std::string& directory : runtime_directories) {
    const auto answer = ask_status(directory);
    if (!answer) continue;
    if (!*answer)
      return not_alone(
          fmt::format("an executive may run in {}: {}; two masters on one bus fight over its drives: end it first",
                      directory, answer->error()));
    return not_alone(
        fmt::format("an executive runs in {}, mode {}: two masters on one bus fight over its drives; end it "
                    "first",
                    directory, name((*answer)->status.tick.mode)));
  }
  return {};
}

std::string_view steps_to_disarm(Mode mode) {
  const bool stands = mode == Mode::damped_stop || mode == Mode::fault_latched;
  return stands ? "`takt reset`, once it rests" : "`takt stop`, then `takt reset`";
}

std::expected<void, Refusal> require_disarmed(const std::vector<std::string>& runtime_directories) {
  for (const std::string& directory : runtime_directories) {
    const auto answer = ask_status(directory);
    if (!answer) continue;
    if (!*answer)
      return not_alone(fmt::format("whether the robot in {} is armed is unknown: {}; end its executive first",
                                   directory, answer->error()));
    const auto& tick = (*answer)->status.tick;
    if (tick.drives_enabled != 0)
      return not_alone(fmt::format("the robot in {} is armed, mode {}: {}, first", directory, name(tick.mode),
                                   steps_to_disarm(tick.mode)));
  }
  return {};
}

}  // namespace takt::cli
