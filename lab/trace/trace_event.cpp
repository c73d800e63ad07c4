// SPDX-License-Identifier: Apache-2.0
#include "lab/trace/trace_event.hpp"

namespace takt::lab {
namespace {

using Names = std::string_view;
constexpr Names kInit[] = {"process", "config_hash", "policy_hash", "joint_count", "joints"};
constexpr Names kTickBegin[] = {"tick", "now_ns", "lateness_ns"};
constexpr Names kCommandConsumed[] = {"tick",     "sequence", "observation_id", "arrival", "sense_ns",
                                      "queue_ns", "infer_ns", "publish_ns",     "hold_ns"};
constexpr Names kObservationPublished[] = {"tick", "observation_id", "oldest_sensed_at_ns", "published_at_ns"};
constexpr Names kTickEnd[] = {"tick", "mode", "freshness", "sequence", "age_ns"};
constexpr Names kDequeueBegin[] = {"after_observation_id"};
constexpr Names kDequeueEnd[] = {"observation_id"};
constexpr Names kInference[] = {"observation_id", "sequence", "at_ns"};
constexpr Names kPublishBegin[] = {"observation_id", "sequence", "outside_sensed_at_ns"};
constexpr Names kPublishEnd[] = {"observation_id", "sequence"};
constexpr Names kDrainBegin[] = {"after_tick"};
constexpr Names kDrainEnd[] = {"last_tick", "recorded_ticks"};
constexpr Names kModeChanged[] = {"tick", "now_ns", "previous_mode", "mode", "cause"};

constexpr TraceEventShape kEvents[] = {
    {EventName::init, "init", kInit},
    {EventName::tick_begin, "tick_begin", kTickBegin},
    {EventName::command_consumed, "command_consumed", kCommandConsumed},
    {EventName::observation_published, "observation_published", kObservationPublished},
    {EventName::tick_end, "tick_end", kTickEnd},
    {EventName::dequeue_begin, "dequeue_begin", kDequeueBegin},
    {EventName::dequeue_end, "dequeue_end", kDequeueEnd},
    {EventName::infer_begin, "infer_begin", kInference},
    {EventName::infer_end, "infer_end", kInference},
    {EventName::publish_begin, "publish_begin", kPublishBegin},
    {EventName::publish_end, "publish_end", kPublishEnd},
    {EventName::drain_begin, "drain_begin", kDrainBegin},
    {EventName::drain_end, "drain_end", kDrainEnd},
    {EventName::mode_changed, "mode_changed", kModeChanged},
};

}  // namespace

std::span<const TraceEventShape> trace_events() {
  return kEvents;
}

}  // namespace takt::lab
