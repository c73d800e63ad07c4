// SPDX-License-Identifier: Apache-2.0
#include "executive/trace/trace.hpp"

#include <lttng/ust-thread.h>

// LTTng's macros put its C into this file: casts, designated initialisers and shadowing are theirs.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic"
#pragma GCC diagnostic ignored "-Wold-style-cast"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wcast-align"
#pragma GCC diagnostic ignored "-Wshadow"
#define LTTNG_UST_TRACEPOINT_CREATE_PROBES
#define LTTNG_UST_TRACEPOINT_DEFINE
#include "executive/trace/provider.hpp"

namespace takt::trace {

void prepare_thread() noexcept {
  lttng_ust_init_thread();
}

void tick_begin(std::uint64_t tick, MonoTime now, Duration lateness) noexcept {
  lttng_ust_tracepoint(takt, tick_begin, tick, now.ns, lateness.ns);
}

void command_consumed(const TickRecordHeader& record) noexcept {
  lttng_ust_tracepoint(takt, command_consumed, &record);
}

void observation_published(const Observation& observation) noexcept {
  lttng_ust_tracepoint(takt, observation_published, observation.tick, observation.id, observation.oldest_sensed_at.ns,
                       observation.published_at.ns);
}

void tick_end(const TickRecordHeader& record) noexcept {
  lttng_ust_tracepoint(takt, tick_end, &record);
}

void dequeue_begin(std::uint64_t after_observation_id) noexcept {
  lttng_ust_tracepoint(takt, dequeue_begin, after_observation_id);
}

void dequeue_end(std::uint64_t observation_id) noexcept {
  lttng_ust_tracepoint(takt, dequeue_end, observation_id);
}

void infer_begin(std::uint64_t observation_id, std::uint64_t sequence, MonoTime at) noexcept {
  lttng_ust_tracepoint(takt, infer_begin, observation_id, sequence, at.ns);
}

void infer_end(std::uint64_t observation_id, std::uint64_t sequence, MonoTime at) noexcept {
  lttng_ust_tracepoint(takt, infer_end, observation_id, sequence, at.ns);
}

void publish_begin(const CommandHeader& command) noexcept {
  lttng_ust_tracepoint(takt, publish_begin, command.observation_id, command.sequence, command.outside_sensed_at.ns);
}

void publish_end(std::uint64_t observation_id, std::uint64_t sequence) noexcept {
  lttng_ust_tracepoint(takt, publish_end, observation_id, sequence);
}

void drain_begin(std::uint64_t after_tick) noexcept {
  lttng_ust_tracepoint(takt, drain_begin, after_tick);
}

void drain_end(std::uint64_t last_tick, std::uint64_t recorded_ticks) noexcept {
  lttng_ust_tracepoint(takt, drain_end, last_tick, recorded_ticks);
}

void mode_changed(const TickRecordHeader& record) noexcept {
  lttng_ust_tracepoint(takt, mode_changed, &record);
}

void Introduction::when_traced(MonoTime now) noexcept {
  constexpr Duration kRepeat = seconds(1);
  if (lttng_ust_tracepoint_enabled(takt, init) == 0 || (said_at_.is_set() && now - said_at_ < kRepeat)) return;
  said_at_ = now;
  lttng_ust_do_tracepoint(takt, init, process_.c_str(), config_hash_, policy_hash_, joint_count_, joints_.c_str());
}

}  // namespace takt::trace
#pragma GCC diagnostic pop
