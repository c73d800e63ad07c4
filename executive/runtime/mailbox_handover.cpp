#include "executive/runtime/mailbox_handover.hpp"

#include <utility>

#include "executive/ipc/executive_segments.hpp"

namespace takt::runtime {

std::expected<std::unique_ptr<CommandMailbox>, std::string> CommandMailbox::seal(ipc::Segment mapped_by_policy,
                                                                                 std::uint8_t session) {
  if (auto sealed = mapped_by_policy.seal_against_new_writers(); !sealed) return std::unexpected(sealed.error());
  if (auto mapped = mapped_by_policy.map_read_only(); !mapped) return std::unexpected(mapped.error());
  auto reader = ipc::SlotReader::attach(mapped_by_policy.readable(), ipc::command_mailbox());
  if (!reader) return std::unexpected(reader.error());
  return std::make_unique<CommandMailbox>(std::move(mapped_by_policy), *reader, session);
}

void MailboxHandover::want(std::unique_ptr<CommandMailbox> mailbox) {
  next_ = std::move(mailbox);
  has_next_ = true;
  settle();
}

void MailboxHandover::settle() {
  if (in_use_.load(std::memory_order_acquire) != published_.get()) return;
  retired_.reset();
  if (!std::exchange(has_next_, false)) return;
  retired_ = std::move(published_);
  published_ = std::move(next_);
  wanted_.store(published_.get(), std::memory_order_release);
}

bool MailboxHandover::is_settled() const {
  return !has_next_ && !retired_ && in_use_.load(std::memory_order_acquire) == published_.get();
}

}  // namespace takt::runtime
