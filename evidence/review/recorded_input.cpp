// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/recorded_input.hpp"

#include <algorithm>
#include <cstring>

#include "executive/pipeline/arrival.hpp"
#include "executive/setup/tick_config_of.hpp"

namespace takt::monitor {
namespace {

// The policies the executive admitted, as it wrote them down itself; a run without that word admitted the configured
// one.
std::uint64_t admitted(const RunManifest& manifest, const char* key) {
  std::string text = manifest.policy_sha256.substr(0, 16);
  if (manifest.executive.is_object() && manifest.executive.contains(key)) {
    text = manifest.executive.at(key).get<std::string>();
  }
  return text.empty() ? 0 : std::stoull(text, nullptr, 16);
}

}  // namespace

pipeline::TickConfig recorded_config(const RecordedRun& run) {
  return config::tick_config_of(run.robot, admitted(run.manifest, "policy_hash"),
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

RecordedInput::Mailbox& RecordedInput::mailbox_of(Player sender) {
  if (sender == Player::candidate) return candidate_;
  return sender == Player::fallback ? fallback_ : policy_;
}

const pipeline::TickInput* RecordedInput::of(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  const FallbackRecord& second = header.fallback;
  const CandidateRecord& third = header.candidate;
  const auto policy = policy_.take(header.tick, header.mailbox, header.policy_session, header.arrival);
  const auto fallback = fallback_.take(header.tick, second.mailbox, second.session, second.arrival);
  const auto candidate = candidate_.take(header.tick, third.mailbox, third.session, third.arrival);
  is_by_header_ = false;
  if (!policy || !fallback || !candidate) return nullptr;
  *input_ = pipeline::input_of(record, policy->command, policy->bytes);
  input_->policy = *policy;
  input_->fallback = *fallback;
  input_->candidate = *candidate;
  is_by_header_ =
      policy->values != Arrival::none || fallback->values != Arrival::none || candidate->values != Arrival::none;
  return input_.get();
}

}  // namespace takt::monitor
