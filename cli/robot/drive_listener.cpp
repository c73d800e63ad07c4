// SPDX-License-Identifier: Apache-2.0
#include "cli/robot/drive_listener.hpp"

#include <poll.h>
#include <unistd.h>

#include <ctime>

#include "drivers/bus/receive_stamp.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::cli {

void DriveListener::turn() {
  std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out;
  const std::size_t frames = driver_.encode(false, {}, {}, {}, out);
  for (std::size_t i = 0; i < frames; ++i) bus_.send(out[i]);
  const timespec time{period_.ns / 1'000'000'000, period_.ns % 1'000'000'000};
  ::nanosleep(&time, nullptr);
  const std::size_t count = bus_.receive(received_);
  for (std::size_t i = 0; i < count; ++i) driver_.decode(received_[i]);
}

bool DriveListener::wait_until_disabled() {
  for (int i = 0; i < kPatience; ++i) {
    turn();
    const JointFeedback& feedback = driver_.feedback();
    const bool wants_home = drivers::kind_of(feedback.error_code) == drivers::SetupFault::home_unknown;
    if (feedback.received_at.is_set() && driver_.is_set_up() &&
        (feedback.drive_state == DriveState::disabled || wants_home))
      return true;
  }
  return false;
}

std::string DriveListener::why_not_disabled(const config::Drive& drive) const {
  const JointFeedback& feedback = driver_.feedback();
  if (feedback.error_code != 0) return "its drive reports " + drivers::error_name(drive, feedback.error_code);
  if (!feedback.received_at.is_set()) return "no answer from its drive: is it powered, and are id and bus right?";
  if (!driver_.is_set_up()) return "its drive does not tell its settings";
  return "its drive does not say that it is disabled";
}

void DriveListener::settle() {
  for (int i = 0; i < kSettle; ++i) turn();
}

std::optional<std::string> DriveListener::wait_for_line() {
  std::string line;
  while (true) {
    turn();
    pollfd input{STDIN_FILENO, POLLIN, 0};
    while (::poll(&input, 1, 0) > 0) {
      char one = 0;
      if (::read(STDIN_FILENO, &one, 1) != 1) return std::nullopt;
      if (one == '\n') return line;
      line += one;
    }
  }
}

}  // namespace takt::cli
