// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/recorded_input.hpp"

#include <algorithm>
#include <cstring>

#include "executive/pipeline/arrival.hpp"
#include "executive/setup/tick_config_of.hpp"

namespace takt::evidence {
namespace {

// The policies the executive admitted, as it wrote them down itself; a run without that word admitted the configured
// one.
std::uint64_t admitted(const monitor::RunManifest& manifest, const char* key) {
  std::string text = manifest.policy_sha256.substr(0, 16);
  if (manifest.executive.is_object() && manifest.executive.contains(key)) {
    text = manifest.executive.at(key).get<std::string>();
  }
  return text.empty() ? 0 : std::stoull(text, nullptr, 16);
}

}  // namespace

pipeline::TickConfig recorded_config(const monitor::RecordedRun& run) {
  return setup::tick_config_of(run.robot, admitted(run.manifest, "policy_hash"),
                               admitted(run.manifest, "fallback_policy_hash"));
}

std::optional<pipeline::PolicyMessage> RecordedInput::Mailbox::take(std::uint64_t tick, Arrival mailbox,
                                                                    std::uint8_t session, Arrival verdict) {
  const bool there = pending && pending->tick == tick;
  if (there != (mailbox == Arrival::accepted)) {
    if (there) pending.reset();
    return std::nullopt;
  }
  pipeline::PolicyMessage message{.mailbox = mailbox, .session = session};
  if (!there) return message;
  *chunk = CommandChunk{};
  message.command = chunk.get();
  message.bytes = std::min(pending->payload.size(), sizeof(CommandChunk));
  std::memcpy(chunk.get(), pending->payload.data(), message.bytes);
  if (pending->cut_from != 0) {
    message.bytes = pending->cut_from;
    message.values = pipeline::values_behind(verdict);
  }
  pending.reset();
  return message;
}

const pipeline::TickInput* RecordedInput::of(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  PerSeat<pipeline::PolicyMessage> messages;
  bool all_there = true;
  is_by_header_ = false;
  for (const Seat seat : kSeats) {
    const SeatRecord& told = header.seats[seat];
    const auto message = mailboxes_[seat].take(header.tick, told.mailbox, told.session, told.arrival);
    if (message) messages[seat] = *message;
    all_there &= message.has_value();
    is_by_header_ |= messages[seat].values != Arrival::none;
  }
  if (!all_there) return nullptr;
  *input_ = pipeline::input_of(record, nullptr, 0);
  input_->messages = messages;
  return input_.get();
}

}  // namespace takt::evidence
