// SPDX-License-Identifier: Apache-2.0
// Gives the control thread another mailbox to read (a policy's commands, the IMU's samples), and takes the old one
// back, without either thread waiting.
//
//   service thread                        control thread, once per tick
//   wanted = B          (S1, release) --> now = wanted            (C1, acquire)
//   ... A still lives ...                 reads from now for the whole tick
//   in_use == B ?       (S2, acquire) <-- in_use = now            (C2, release)
//   only then: free A
//
// The bad interleaving is C1 loading A just before S1, and A freed before that tick ends. S2 rules it out: in_use only
// becomes B after the tick in which C1 saw B began, and A can then never be loaded again. For the same to hold for the
// next change, `wanted` is changed again only after in_use has caught up; what is asked for in between waits its turn.
// A control thread that stands still keeps its mailbox: nothing is freed.
//
// Thread rules: current() control thread; everything else the service thread. The control thread never frees.
#pragma once

#include <atomic>
#include <cstdint>
#include <expected>
#include <memory>
#include <string>
#include <utility>

#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::runtime {

// One policy session's commands, as the executive reads them.
struct CommandMailbox {
  ipc::Segment segment;
  ipc::SlotReader reader;         // control thread
  std::uint8_t session = 0;       // differs from the previous session's
  std::uint64_t policy_hash = 0;  // as its policy was admitted

  // Seals the segment, which the policy has mapped, against further writers, maps it read-only and checks its header.
  static std::expected<std::unique_ptr<CommandMailbox>, std::string> seal(ipc::Segment mapped_by_policy,
                                                                          std::uint8_t session,
                                                                          std::uint64_t policy_hash = 0);
};

template <class Mailbox>
class Handover {
 public:
  Handover() = default;
  Handover(const Handover&) = delete;
  Handover& operator=(const Handover&) = delete;

  // Reads from `mailbox` as soon as possible; null: from none.
  void want(std::unique_ptr<Mailbox> mailbox) {
    next_ = std::move(mailbox);
    has_next_ = true;
    settle();
  }
  // Frees what the control thread has let go of. Call it now and then.
  void settle() {
    if (in_use_.load(std::memory_order_acquire) != published_.get()) return;
    retired_.reset();
    if (!std::exchange(has_next_, false)) return;
    retired_ = std::move(published_);
    published_ = std::move(next_);
    wanted_.store(published_.get(), std::memory_order_release);
  }
  // The control thread reads what was last asked for, and nothing else is kept.
  [[nodiscard]] bool is_settled() const {
    return !has_next_ && !retired_ && in_use_.load(std::memory_order_acquire) == published_.get();
  }

  // Null: none. Valid until the next call.
  Mailbox* current() noexcept {
    Mailbox* const now = wanted_.load(std::memory_order_acquire);
    in_use_.store(now, std::memory_order_release);
    return now;
  }

 private:
  std::atomic<Mailbox*> wanted_ = nullptr;
  std::atomic<Mailbox*> in_use_ = nullptr;
  std::unique_ptr<Mailbox> published_;  // behind wanted_
  std::unique_ptr<Mailbox> retired_;    // published before, perhaps still read
  std::unique_ptr<Mailbox> next_;
  bool has_next_ = false;
};

using MailboxHandover = Handover<CommandMailbox>;

}  // namespace takt::runtime
