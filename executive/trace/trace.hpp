// SPDX-License-Identifier: Apache-2.0
// Trace points of LTTng-UST provider `takt`: compiled in, off until a tracing session asks for them (docs/tracing.md).
//
// Off, each function is a call and one branch. On, it writes one event of a few integers into LTTng's per-core buffers:
// no lock and no allocation on a thread that called prepare_thread(). Times in ns of CLOCK_MONOTONIC, the trace's own
// clock. Identities that tie events together across processes: tick, observation id, command sequence.
// Thread rule: any thread, any time. No errors: LTTng counts what it had no room for, and the trace's reader says so.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::trace {

// Does now what LTTng would otherwise do at the thread's first event: allocate, lock. For threads that must not.
void prepare_thread() noexcept;

// Control loop, at most four per tick.
void tick_begin(std::uint64_t tick, MonoTime now, Duration lateness) noexcept;
// For ticks that read a message. Sequence and arrival are the message's; observation and age parts those of the
// command in use after the tick, which is the message's own when it was accepted.
void command_consumed(const TickRecordHeader& record) noexcept;
void observation_published(const Observation& observation) noexcept;
void tick_end(const TickRecordHeader& record) noexcept;

// Policy host.
void dequeue_begin(std::uint64_t after_observation_id) noexcept;
void dequeue_end(std::uint64_t observation_id) noexcept;  // 0: there was nothing new
// `at`: the stamp that goes into the command.
void infer_begin(std::uint64_t observation_id, std::uint64_t sequence, MonoTime at) noexcept;
void infer_end(std::uint64_t observation_id, std::uint64_t sequence, MonoTime at) noexcept;
void publish_begin(const CommandHeader& command) noexcept;
void publish_end(std::uint64_t observation_id, std::uint64_t sequence) noexcept;

// Monitor.
void drain_begin(std::uint64_t after_tick) noexcept;
void drain_end(std::uint64_t last_tick, std::uint64_t recorded_ticks) noexcept;
// For recorded ticks that changed the mode. Not from the control thread, so that what a tracing session hangs on this
// event (a snapshot) costs it nothing; up to one look into the rings later than the change.
void mode_changed(const TickRecordHeader& record) noexcept;

// Says in the trace who this process is, once a second while it is traced: what a session drops while it starts, or a
// flight recorder overwrites, comes again.
class Introduction {
 public:
  // `joints`: each with a `name`, in the robot file's order. Hashes as in Hello; 0: not known to this process.
  template <class Joints>
  Introduction(std::string process, std::uint64_t config_hash, std::uint64_t policy_hash, const Joints& joints)
      : process_(std::move(process)), config_hash_(config_hash), policy_hash_(policy_hash) {
    for (const auto& joint : joints) {
      joints_ += (joint_count_ == 0 ? "" : ",") + joint.name;
      ++joint_count_;
    }
  }
  // To be called now and then by a thread that is not the control thread. No system call while tracing is off.
  void when_traced(MonoTime now) noexcept;

 private:
  std::string process_;
  std::uint64_t config_hash_;
  std::uint64_t policy_hash_;
  std::uint32_t joint_count_ = 0;
  std::string joints_;
  MonoTime said_at_;  // unset: never
};

}  // namespace takt::trace
