// SPDX-License-Identifier: Apache-2.0
// A recorded tick's input, put together again from its record and the message it read: what replay feeds to the
// decision.
#pragma once

#include <memory>
#include <optional>

#include "executive/pipeline/control_tick.hpp"
#include "monitor/record/recorded_run.hpp"

namespace takt::evidence {

// The configuration that the recorded executive decided by, its admitted policy included.
pipeline::TickConfig recorded_config(const monitor::RecordedRun& run);

// Thread rule: one thread.
class RecordedInput {
 public:
  // Call before of() of the tick that read it.
  void command(monitor::RecordedCommand command) {
    mailboxes_[seat_of(command.sender).value_or(Seat::policy)].pending = std::move(command);
  }
  // Valid until the next call; null: the tick read a message that is not in the recording, or was told of one that it
  // did not read.
  const pipeline::TickInput* of(const TickRecord& record);
  // Of a message that the newest tick read only the header was kept.
  [[nodiscard]] bool is_by_header() const { return is_by_header_; }

 private:
  struct Mailbox {
    std::unique_ptr<CommandChunk> chunk = std::make_unique<CommandChunk>();
    std::optional<monitor::RecordedCommand> pending{};
    // What that tick read; nothing: the recording and the record disagree. `verdict`: the record's, on the message.
    std::optional<pipeline::PolicyMessage> take(std::uint64_t tick, Arrival mailbox, std::uint8_t session,
                                                Arrival verdict);
  };

  PerSeat<Mailbox> mailboxes_;
  std::unique_ptr<pipeline::TickInput> input_ = std::make_unique<pipeline::TickInput>();
  bool is_by_header_ = false;
};

}  // namespace takt::evidence
