// SPDX-License-Identifier: Apache-2.0
// The 1 kHz loop: waits for the period, gathers the tick's inputs, lets the pure tick decide, carries out and records
// what it decided. Everything here is allocated before the first tick.
//
// A setpoint that is too late when its frame is due stays behind, and the drive is told to damp (drive_edge.hpp): the
// next tick reads that as an input, goes on from the damping, and records it.
//
// A tick that ends after the next period began is an overrun: the periods that have passed are skipped, phase is kept,
// and the cause reaches the next tick as an input. The loop ends when asked (finish), after telling the drives to
// disable for kFarewellTicks periods; those frames carry the last tick's number and have no tick record.
//
// Thread rules: run() control thread, finish() any. Inside run(): no allocation, lock, wake-up of another thread, log
// call or exception, and only the system calls of declared_syscalls.hpp.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/pace.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/runtime/clock.hpp"
#include "executive/runtime/drive_edge.hpp"
#include "executive/runtime/evidence.hpp"
#include "executive/runtime/imu_link.hpp"
#include "executive/runtime/mailbox_handover.hpp"
#include "executive/runtime/operator_inbox.hpp"
#include "executive/runtime/published_segments.hpp"
#include "executive/runtime/recorded_through.hpp"
#include "executive/runtime/refused_bytes.hpp"
#include "executive/runtime/status_board.hpp"
#include "executive/runtime/suspend_watch.hpp"
#include "executive/runtime/wakeup.hpp"

namespace takt::runtime {

inline constexpr int kFarewellTicks = 20;

struct LoopTiming {
  config::WakeMode wake = config::WakeMode::sleep;
  Duration spin;                           // hybrid only
  std::uint32_t keyframe_every_ticks = 0;  // >= 1
};

// What the loop works with; all of it outlives the loop.
struct LoopParts {
  const pipeline::TickConfig& config;
  Clock& clock;
  DriveEdge& edge;
  PerSeat<MailboxHandover>& mailboxes;
  OperatorInbox& requests;
  const RecordedThrough& recorded;
  PublishedSegments& published;
  StatusBoard& board;
  Handover<ImuMailbox>* imu = nullptr;  // null: the robot has none
};

class CyclicLoop {
 public:
  CyclicLoop(const LoopParts& parts, const LoopTiming& timing);

  // Until finish(), or for `ticks` ticks.
  void run(const EvidenceSource& evidence, std::uint64_t ticks = std::numeric_limits<std::uint64_t>::max()) noexcept;
  void finish() noexcept { finishing_.store(true, std::memory_order_release); }

 private:
  std::size_t tick(MonoTime woken, Duration lateness) noexcept;  // returns the number of frames received
  void read_commands() noexcept;
  pipeline::PolicyMessage read_command(CommandMailbox* mailbox, std::uint8_t session_before,
                                       CommandChunk& copy) noexcept;
  void read_imu() noexcept;
  void record() noexcept;
  void record_command(Seat seat) noexcept;
  void publish_status() noexcept;
  void say_farewell(Pace& pace) noexcept;

  LoopParts parts_;
  LoopTiming timing_;
  Wakeup wakeup_;
  SuspendWatch suspend_;
  std::atomic<bool> finishing_ = false;
  pipeline::TickStatePtr state_;
  pipeline::TickInput input_;
  pipeline::TickOutput output_;
  bool candidate_in_charge_ = false;  // whose mailbox is whose, as the tick before left it
  std::unique_ptr<PerSeat<CommandChunk>> commands_;
  RefusedBytes refused_bytes_;
  std::vector<std::byte> keyframe_;
  StatusSnapshot status_;
};

}  // namespace takt::runtime
