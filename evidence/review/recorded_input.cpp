#include "evidence/review/recorded_input.hpp"

#include <algorithm>
#include <cstring>

#include "executive/pipeline/arrival.hpp"
#include "executive/setup/tick_config_of.hpp"

namespace takt::monitor {
namespace {

// The policy the executive admitted, as it wrote it down itself; a run without that word admitted the configured one.
std::uint64_t policy_hash_of(const RunManifest& manifest) {
  std::string text = manifest.policy_sha256.substr(0, 16);
  if (manifest.executive.is_object() && manifest.executive.contains("policy_hash")) {
    text = manifest.executive.at("policy_hash").get<std::string>();
  }
  return text.empty() ? 0 : std::stoull(text, nullptr, 16);
}

}  // namespace

pipeline::TickConfig recorded_config(const RecordedRun& run) {
  return config::tick_config_of(run.robot, policy_hash_of(run.manifest));
}

const pipeline::TickInput* RecordedInput::of(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  const bool there = pending_ && pending_->tick == header.tick;
  std::size_t bytes = 0;
  is_by_header_ = there && pending_->cut_from != 0;
  if (there) {
    *chunk_ = CommandChunk{};
    bytes = std::min(pending_->payload.size(), sizeof(CommandChunk));
    std::memcpy(chunk_.get(), pending_->payload.data(), bytes);
    if (is_by_header_) bytes = pending_->cut_from;
    pending_.reset();
  }
  const bool has_read = header.mailbox == Arrival::accepted;
  *input_ = pipeline::input_of(record, has_read ? chunk_.get() : nullptr, bytes);
  if (is_by_header_) input_->command_values = pipeline::values_behind(header.arrival);
  return there == has_read ? input_.get() : nullptr;
}

}  // namespace takt::monitor
