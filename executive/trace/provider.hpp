// SPDX-License-Identifier: Apache-2.0
// The events of LTTng-UST provider `takt`, as LTTng's macros want them: this header is read several times. Only
// trace.cpp includes it; what the events mean is said in trace.hpp and docs/tracing.md.
#undef LTTNG_UST_TRACEPOINT_PROVIDER
#define LTTNG_UST_TRACEPOINT_PROVIDER takt
#undef LTTNG_UST_TRACEPOINT_INCLUDE
#define LTTNG_UST_TRACEPOINT_INCLUDE "executive/trace/provider.hpp"

// No #pragma once: LTTng reads the header again for each of its purposes.
#if !defined(TAKT_TRACE_PROVIDER_HPP) || defined(LTTNG_UST_TRACEPOINT_HEADER_MULTI_READ)
#define TAKT_TRACE_PROVIDER_HPP

#include <lttng/tracepoint.h>

#include <cstdint>

// clang-format off
LTTNG_UST_TRACEPOINT_EVENT(takt, init,
  LTTNG_UST_TP_ARGS(const char*, process, std::uint64_t, config_hash, std::uint64_t, policy_hash,
                    std::uint32_t, joint_count, const char*, joints),
  LTTNG_UST_TP_FIELDS(
    lttng_ust_field_string(process, process)
    lttng_ust_field_integer_hex(std::uint64_t, config_hash, config_hash)
    lttng_ust_field_integer_hex(std::uint64_t, policy_hash, policy_hash)
    lttng_ust_field_integer(std::uint32_t, joint_count, joint_count)
    lttng_ust_field_string(joints, joints)))

LTTNG_UST_TRACEPOINT_EVENT(takt, tick_begin,
  LTTNG_UST_TP_ARGS(std::uint64_t, tick, std::int64_t, now_ns, std::int64_t, lateness_ns),
  LTTNG_UST_TP_FIELDS(
    lttng_ust_field_integer(std::uint64_t, tick, tick)
    lttng_ust_field_integer(std::int64_t, now_ns, now_ns)
    lttng_ust_field_integer(std::int64_t, lateness_ns, lateness_ns)))

LTTNG_UST_TRACEPOINT_EVENT(takt, command_consumed,
  LTTNG_UST_TP_ARGS(const takt::TickRecordHeader*, record),
  LTTNG_UST_TP_FIELDS(
    lttng_ust_field_integer(std::uint64_t, tick, record->tick)
    lttng_ust_field_integer(std::uint64_t, sequence, record->seats[takt::Seat::policy].command_sequence_seen)
    lttng_ust_field_integer(std::uint64_t, observation_id, record->seats[takt::Seat::policy].observation_answered)
    lttng_ust_field_integer(std::uint8_t, arrival, static_cast<std::uint8_t>(record->seats[takt::Seat::policy].arrival))
    lttng_ust_field_integer(std::int64_t, sense_ns, record->age.sense.ns)
    lttng_ust_field_integer(std::int64_t, queue_ns, record->age.queue.ns)
    lttng_ust_field_integer(std::int64_t, infer_ns, record->age.infer.ns)
    lttng_ust_field_integer(std::int64_t, publish_ns, record->age.publish.ns)
    lttng_ust_field_integer(std::int64_t, hold_ns, record->age.hold.ns)))

LTTNG_UST_TRACEPOINT_EVENT(takt, observation_published,
  LTTNG_UST_TP_ARGS(std::uint64_t, tick, std::uint64_t, observation_id, std::int64_t, oldest_sensed_at_ns,
                    std::int64_t, published_at_ns),
  LTTNG_UST_TP_FIELDS(
    lttng_ust_field_integer(std::uint64_t, tick, tick)
    lttng_ust_field_integer(std::uint64_t, observation_id, observation_id)
    lttng_ust_field_integer(std::int64_t, oldest_sensed_at_ns, oldest_sensed_at_ns)
    lttng_ust_field_integer(std::int64_t, published_at_ns, published_at_ns)))

LTTNG_UST_TRACEPOINT_EVENT(takt, tick_end,
  LTTNG_UST_TP_ARGS(const takt::TickRecordHeader*, record),
  LTTNG_UST_TP_FIELDS(
    lttng_ust_field_integer(std::uint64_t, tick, record->tick)
    lttng_ust_field_integer(std::uint8_t, mode, static_cast<std::uint8_t>(record->mode))
    lttng_ust_field_integer(std::uint8_t, freshness, static_cast<std::uint8_t>(record->seats[takt::Seat::policy].freshness))
    lttng_ust_field_integer(std::uint64_t, sequence, record->seats[takt::Seat::policy].command_sequence)
    lttng_ust_field_integer(std::int64_t, age_ns, record->age.total().ns)))

LTTNG_UST_TRACEPOINT_EVENT(takt, dequeue_begin,
  LTTNG_UST_TP_ARGS(std::uint64_t, after_observation_id),
  LTTNG_UST_TP_FIELDS(lttng_ust_field_integer(std::uint64_t, after_observation_id, after_observation_id)))

LTTNG_UST_TRACEPOINT_EVENT(takt, dequeue_end,
  LTTNG_UST_TP_ARGS(std::uint64_t, observation_id),
  LTTNG_UST_TP_FIELDS(lttng_ust_field_integer(std::uint64_t, observation_id, observation_id)))

LTTNG_UST_TRACEPOINT_EVENT_CLASS(takt, inference,
  LTTNG_UST_TP_ARGS(std::uint64_t, observation_id, std::uint64_t, sequence, std::int64_t, at_ns),
  LTTNG_UST_TP_FIELDS(
    lttng_ust_field_integer(std::uint64_t, observation_id, observation_id)
    lttng_ust_field_integer(std::uint64_t, sequence, sequence)
    lttng_ust_field_integer(std::int64_t, at_ns, at_ns)))
#define TAKT_INFERENCE_EVENT(name)                                \
  LTTNG_UST_TRACEPOINT_EVENT_INSTANCE(takt, inference, takt, name, \
    LTTNG_UST_TP_ARGS(std::uint64_t, observation_id, std::uint64_t, sequence, std::int64_t, at_ns))
TAKT_INFERENCE_EVENT(infer_begin)
TAKT_INFERENCE_EVENT(infer_end)
#undef TAKT_INFERENCE_EVENT

LTTNG_UST_TRACEPOINT_EVENT(takt, publish_begin,
  LTTNG_UST_TP_ARGS(std::uint64_t, observation_id, std::uint64_t, sequence, std::int64_t, outside_sensed_at_ns),
  LTTNG_UST_TP_FIELDS(
    lttng_ust_field_integer(std::uint64_t, observation_id, observation_id)
    lttng_ust_field_integer(std::uint64_t, sequence, sequence)
    lttng_ust_field_integer(std::int64_t, outside_sensed_at_ns, outside_sensed_at_ns)))

LTTNG_UST_TRACEPOINT_EVENT(takt, publish_end,
  LTTNG_UST_TP_ARGS(std::uint64_t, observation_id, std::uint64_t, sequence),
  LTTNG_UST_TP_FIELDS(
    lttng_ust_field_integer(std::uint64_t, observation_id, observation_id)
    lttng_ust_field_integer(std::uint64_t, sequence, sequence)))

LTTNG_UST_TRACEPOINT_EVENT(takt, drain_begin,
  LTTNG_UST_TP_ARGS(std::uint64_t, after_tick),
  LTTNG_UST_TP_FIELDS(lttng_ust_field_integer(std::uint64_t, after_tick, after_tick)))

LTTNG_UST_TRACEPOINT_EVENT(takt, drain_end,
  LTTNG_UST_TP_ARGS(std::uint64_t, last_tick, std::uint64_t, recorded_ticks),
  LTTNG_UST_TP_FIELDS(
    lttng_ust_field_integer(std::uint64_t, last_tick, last_tick)
    lttng_ust_field_integer(std::uint64_t, recorded_ticks, recorded_ticks)))

LTTNG_UST_TRACEPOINT_EVENT(takt, mode_changed,
  LTTNG_UST_TP_ARGS(const takt::TickRecordHeader*, record),
  LTTNG_UST_TP_FIELDS(
    lttng_ust_field_integer(std::uint64_t, tick, record->tick)
    lttng_ust_field_integer(std::int64_t, now_ns, record->now.ns)
    lttng_ust_field_integer(std::uint8_t, previous_mode, static_cast<std::uint8_t>(record->previous_mode))
    lttng_ust_field_integer(std::uint8_t, mode, static_cast<std::uint8_t>(record->mode))
    lttng_ust_field_integer(std::uint8_t, cause, static_cast<std::uint8_t>(record->cause))))
// clang-format on

#endif

#include <lttng/tracepoint-event.h>
