// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/mailbox_handover.hpp"

#include <utility>

#include "executive/ipc/executive_segments.hpp"

namespace takt::runtime {

std::expected<std::unique_ptr<CommandMailbox>, std::string> CommandMailbox::seal(ipc::Segment mapped_by_policy,
                                                                                 std::uint8_t session,
                                                                                 std::uint64_t policy_hash) {
  if (auto sealed = mapped_by_policy.seal_against_new_writers(); !sealed) return std::unexpected(sealed.error());
  if (auto mapped = mapped_by_policy.map_read_only(); !mapped) return std::unexpected(mapped.error());
  auto reader = ipc::SlotReader::attach(mapped_by_policy.readable(), ipc::command_mailbox());
  if (!reader) return std::unexpected(reader.error());
  return std::make_unique<CommandMailbox>(std::move(mapped_by_policy), *reader, session, policy_hash);
}

}  // namespace takt::runtime
