// SPDX-License-Identifier: Apache-2.0
#include "lab/trace/trace_reader.hpp"

#include <babeltrace2/babeltrace.h>
#include <fmt/format.h>

#include <array>
#include <memory>
#include <optional>
#include <unordered_map>

#include "lab/trace/trace_folders.hpp"

namespace takt::lab {
namespace {

constexpr std::string_view kProvider = "takt:";

template <auto release>
struct Release {
  template <class T>
  void operator()(const T* object) const {
    release(object);
  }
};
template <class T, auto release>
using Held = std::unique_ptr<T, Release<release>>;
using Graph = Held<bt_graph, bt_graph_put_ref>;
using Plugin = Held<const bt_plugin, bt_plugin_put_ref>;
using Value = Held<bt_value, bt_value_put_ref>;

// Where a field's value goes. Integers arrive as 64 bits, sign extended.
using SetNumber = void (*)(TraceEvent& event, std::int64_t value);
struct NumberField {
  std::string_view name;
  SetNumber set;
};

std::uint64_t whole(std::int64_t value) {
  return static_cast<std::uint64_t>(value);
}
std::uint8_t small(std::int64_t value) {
  return static_cast<std::uint8_t>(value);
}

constexpr NumberField kNumbers[] = {
    {"tick", [](TraceEvent& e, std::int64_t v) { e.tick = whole(v); }},
    {"after_tick", [](TraceEvent& e, std::int64_t v) { e.tick = whole(v); }},
    {"last_tick", [](TraceEvent& e, std::int64_t v) { e.tick = whole(v); }},
    {"observation_id", [](TraceEvent& e, std::int64_t v) { e.observation_id = whole(v); }},
    {"after_observation_id", [](TraceEvent& e, std::int64_t v) { e.observation_id = whole(v); }},
    {"sequence", [](TraceEvent& e, std::int64_t v) { e.sequence = whole(v); }},
    {"now_ns", [](TraceEvent& e, std::int64_t v) { e.stamp.ns = v; }},
    {"at_ns", [](TraceEvent& e, std::int64_t v) { e.stamp.ns = v; }},
    {"oldest_sensed_at_ns", [](TraceEvent& e, std::int64_t v) { e.sensed.ns = v; }},
    {"outside_sensed_at_ns", [](TraceEvent& e, std::int64_t v) { e.sensed.ns = v; }},
    {"published_at_ns", [](TraceEvent& e, std::int64_t v) { e.published.ns = v; }},
    {"lateness_ns", [](TraceEvent& e, std::int64_t v) { e.lateness.ns = v; }},
    {"sense_ns", [](TraceEvent& e, std::int64_t v) { e.age.sense.ns = v; }},
    {"queue_ns", [](TraceEvent& e, std::int64_t v) { e.age.queue.ns = v; }},
    {"infer_ns", [](TraceEvent& e, std::int64_t v) { e.age.infer.ns = v; }},
    {"publish_ns", [](TraceEvent& e, std::int64_t v) { e.age.publish.ns = v; }},
    {"hold_ns", [](TraceEvent& e, std::int64_t v) { e.age.hold.ns = v; }},
    {"age_ns", [](TraceEvent& e, std::int64_t v) { e.age_total.ns = v; }},
    {"previous_mode", [](TraceEvent& e, std::int64_t v) { e.previous_mode = small(v); }},
    {"mode", [](TraceEvent& e, std::int64_t v) { e.mode = small(v); }},
    {"cause", [](TraceEvent& e, std::int64_t v) { e.cause = small(v); }},
    {"freshness", [](TraceEvent& e, std::int64_t v) { e.freshness = small(v); }},
    {"arrival", [](TraceEvent& e, std::int64_t v) { e.arrival = small(v); }},
    {"config_hash", [](TraceEvent& e, std::int64_t v) { e.config_hash = whole(v); }},
    {"policy_hash", [](TraceEvent& e, std::int64_t v) { e.policy_hash = whole(v); }},
};

// How one class of events is read: found out once, for a trace has millions of events and a dozen classes.
struct ReadingPlan {
  std::optional<EventName> event;  // none: not of Takt
  struct Member {
    std::uint64_t index;
    SetNumber set_number;  // null for text
    std::string TraceEvent::*text;
  };
  std::vector<Member> members;
};

std::optional<std::int64_t> number_of(const bt_field* field) {
  if (field == nullptr) return std::nullopt;
  const bt_field_class_type type = bt_field_get_class_type(field);
  if (bt_field_class_type_is(type, BT_FIELD_CLASS_TYPE_UNSIGNED_INTEGER))
    return static_cast<std::int64_t>(bt_field_integer_unsigned_get_value(field));
  if (bt_field_class_type_is(type, BT_FIELD_CLASS_TYPE_SIGNED_INTEGER)) return bt_field_integer_signed_get_value(field);
  return std::nullopt;
}

SetNumber setter_of(std::string_view name) {
  for (const NumberField& field : kNumbers) {
    if (field.name == name) return field.set;
  }
  return nullptr;
}

class Reader {
 public:
  explicit Reader(const std::function<void(const TraceEvent&)>& visit) : visit_(visit) {}

  // One batch of messages. False: no more, or failed().
  bool next(bt_message_iterator* messages) {
    bt_message_array_const batch = nullptr;
    std::uint64_t count = 0;
    const auto status = bt_message_iterator_next(messages, &batch, &count);
    if (status == BT_MESSAGE_ITERATOR_NEXT_STATUS_END) return false;
    if (status != BT_MESSAGE_ITERATOR_NEXT_STATUS_OK) {
      failed_ = true;
      return false;
    }
    for (std::uint64_t i = 0; i < count; ++i) {
      message(batch[i]);
      bt_message_put_ref(batch[i]);
    }
    return true;
  }

  [[nodiscard]] bool failed() const { return failed_; }  // babeltrace's own error, still to be asked for
  TraceReading reading;

 private:
  void message(const bt_message* message) {
    const bt_message_type type = bt_message_get_type(message);
    if (type == BT_MESSAGE_TYPE_EVENT) event(message);
    if (type == BT_MESSAGE_TYPE_DISCARDED_EVENTS) discarded_events(message);
    if (type == BT_MESSAGE_TYPE_DISCARDED_PACKETS) discarded_packets(message);
  }

  void event(const bt_message* message) {
    const bt_event* const from = bt_message_event_borrow_event_const(message);
    const ReadingPlan& plan = plan_of(from);
    if (!plan.event) {
      ++reading.other_events;
      return;
    }
    ++reading.events;
    TraceEvent event;
    event.name = *plan.event;
    const bt_clock_snapshot* const clock = bt_message_event_borrow_default_clock_snapshot_const(message);
    // Not "from origin": LTTng puts the distance to Unix time there, and its cycles are CLOCK_MONOTONIC's nanoseconds.
    event.at.ns = static_cast<std::int64_t>(bt_clock_snapshot_get_value(clock));
    event.pid = pid_of(from);
    const bt_field* const payload = bt_event_borrow_payload_field_const(from);
    for (const ReadingPlan::Member& member : plan.members) {
      const bt_field* const field = bt_field_structure_borrow_member_field_by_index_const(payload, member.index);
      if (member.set_number != nullptr)
        member.set_number(event, number_of(field).value_or(0));
      else
        event.*member.text = bt_field_string_get_value(field);
    }
    visit_(event);
  }

  static std::int64_t pid_of(const bt_event* event) {
    for (const bt_field* context :
         {bt_event_borrow_common_context_field_const(event), bt_event_borrow_specific_context_field_const(event)}) {
      if (context == nullptr) continue;
      const auto pid = number_of(bt_field_structure_borrow_member_field_by_name_const(context, "vpid"));
      if (pid) return *pid;
    }
    return 0;
  }

  const ReadingPlan& plan_of(const bt_event* event) {
    const bt_event_class* const event_class = bt_event_borrow_class_const(event);
    const auto known = plans_.find(event_class);
    return known != plans_.end() ? known->second : plans_.emplace(event_class, make_plan(event)).first->second;
  }

  ReadingPlan make_plan(const bt_event* event) {
    const bt_event_class* const event_class = bt_event_borrow_class_const(event);
    const char* const called = bt_event_class_get_name(event_class);
    const std::string_view name = called == nullptr ? "" : called;
    if (!name.starts_with(kProvider)) return {};
    for (const TraceEventShape& shape : trace_events()) {
      if (shape.name == name.substr(kProvider.size())) return make_plan(shape, event_class);
    }
    return {};
  }

  ReadingPlan make_plan(const TraceEventShape& shape, const bt_event_class* event_class) {
    ReadingPlan plan{shape.event, {}};
    const bt_field_class* const payload = bt_event_class_borrow_payload_field_class_const(event_class);
    for (const std::string_view wanted : shape.fields) {
      const auto index = index_of(payload, wanted);
      if (!index) {
        reading.unreadable.push_back(fmt::format("takt:{} without field {}", shape.name, wanted));
        return {};
      }
      if (const SetNumber set = setter_of(wanted); set != nullptr) plan.members.push_back({*index, set, nullptr});
      if (wanted == "process") plan.members.push_back({*index, nullptr, &TraceEvent::process});
      if (wanted == "joints") plan.members.push_back({*index, nullptr, &TraceEvent::joints});
    }
    return plan;
  }

  static std::optional<std::uint64_t> index_of(const bt_field_class* structure, std::string_view name) {
    for (std::uint64_t i = 0; structure != nullptr && i < bt_field_class_structure_get_member_count(structure); ++i) {
      const auto* const member = bt_field_class_structure_borrow_member_by_index_const(structure, i);
      if (name == bt_field_class_structure_member_get_name(member)) return i;
    }
    return std::nullopt;
  }

  static MonoTime instant(const bt_clock_snapshot* clock) {
    return {clock == nullptr ? 0 : static_cast<std::int64_t>(bt_clock_snapshot_get_value(clock))};
  }

  void discarded_events(const bt_message* message) {
    TraceLoss loss{.what = TraceLoss::What::events, .count = 0, .from = {}, .to = {}};
    if (bt_message_discarded_events_get_count(message, &loss.count) != BT_PROPERTY_AVAILABILITY_AVAILABLE)
      loss.count = 0;
    const auto* const stream_class =
        bt_stream_borrow_class_const(bt_message_discarded_events_borrow_stream_const(message));
    if (bt_stream_class_discarded_events_have_default_clock_snapshots(stream_class) != 0) {
      loss.from = instant(bt_message_discarded_events_borrow_beginning_default_clock_snapshot_const(message));
      loss.to = instant(bt_message_discarded_events_borrow_end_default_clock_snapshot_const(message));
    }
    reading.losses.push_back(loss);
  }

  void discarded_packets(const bt_message* message) {
    TraceLoss loss{.what = TraceLoss::What::packets, .count = 0, .from = {}, .to = {}};
    if (bt_message_discarded_packets_get_count(message, &loss.count) != BT_PROPERTY_AVAILABILITY_AVAILABLE)
      loss.count = 0;
    const auto* const stream_class =
        bt_stream_borrow_class_const(bt_message_discarded_packets_borrow_stream_const(message));
    if (bt_stream_class_discarded_packets_have_default_clock_snapshots(stream_class) != 0) {
      loss.from = instant(bt_message_discarded_packets_borrow_beginning_default_clock_snapshot_const(message));
      loss.to = instant(bt_message_discarded_packets_borrow_end_default_clock_snapshot_const(message));
    }
    reading.losses.push_back(loss);
  }

  const std::function<void(const TraceEvent&)>& visit_;
  std::unordered_map<const bt_event_class*, ReadingPlan> plans_;
  bool failed_ = false;
};

// What babeltrace says went wrong in this thread, from the first cause.
std::string last_error() {
  const bt_error* const error = bt_current_thread_take_error();
  if (error == nullptr) return "no reason given";
  std::string text = "no reason given";
  if (bt_error_get_cause_count(error) != 0) text = bt_error_cause_get_message(bt_error_borrow_cause_by_index(error, 0));
  bt_error_release(error);
  return text;
}

const bt_component_class_source* ctf_source(const Plugin& plugin) {
  return plugin ? bt_plugin_borrow_source_component_class_by_name_const(plugin.get(), "fs") : nullptr;
}

Plugin find_plugin(const char* name) {
  const bt_plugin* plugin = nullptr;
  if (bt_plugin_find(name, BT_TRUE, BT_TRUE, BT_TRUE, BT_TRUE, BT_FALSE, &plugin) != BT_PLUGIN_FIND_STATUS_OK)
    return {};
  return Plugin(plugin);
}

Value folder_parameter(const std::string& folder) {
  Value parameters(bt_value_map_create());
  bt_value* inputs = nullptr;
  if (!parameters ||
      bt_value_map_insert_empty_array_entry(parameters.get(), "inputs", &inputs) !=
          BT_VALUE_MAP_INSERT_ENTRY_STATUS_OK ||
      bt_value_array_append_string_element(inputs, folder.c_str()) != BT_VALUE_ARRAY_APPEND_ELEMENT_STATUS_OK)
    return {};
  return parameters;
}

// Joins every output of a source to the muxer, which grows an input for each.
bool join(bt_graph* graph, const bt_component_source* source, const bt_component_filter* muxer) {
  for (std::uint64_t i = 0; i < bt_component_source_get_output_port_count(source); ++i) {
    const auto* const from = bt_component_source_borrow_output_port_by_index_const(source, i);
    const std::uint64_t free_input = bt_component_filter_get_input_port_count(muxer) - 1;
    const auto* const to = bt_component_filter_borrow_input_port_by_index_const(muxer, free_input);
    if (bt_graph_connect_ports(graph, from, to, nullptr) != BT_GRAPH_CONNECT_PORTS_STATUS_OK) return false;
  }
  return true;
}

bt_graph_simple_sink_component_consume_func_status consume(bt_message_iterator* messages, void* user) {
  auto& reader = *static_cast<Reader*>(user);
  if (reader.next(messages)) return BT_GRAPH_SIMPLE_SINK_COMPONENT_CONSUME_FUNC_STATUS_OK;
  return reader.failed() ? BT_GRAPH_SIMPLE_SINK_COMPONENT_CONSUME_FUNC_STATUS_ERROR
                         : BT_GRAPH_SIMPLE_SINK_COMPONENT_CONSUME_FUNC_STATUS_END;
}

// source.ctf.fs per folder -> filter.utils.muxer -> reader. False: last_error() says why.
bool build(bt_graph* graph, const Plugin& ctf, const Plugin& utils, const std::vector<std::string>& folders,
           Reader& reader) {
  const auto* const muxer_class = bt_plugin_borrow_filter_component_class_by_name_const(utils.get(), "muxer");
  const bt_component_filter* muxer = nullptr;
  if (bt_graph_add_filter_component(graph, muxer_class, "muxer", nullptr, BT_LOGGING_LEVEL_NONE, &muxer) !=
      BT_GRAPH_ADD_COMPONENT_STATUS_OK)
    return false;
  for (const std::string& folder : folders) {
    const Value parameters = folder_parameter(folder);
    const bt_component_source* source = nullptr;
    if (bt_graph_add_source_component(graph, ctf_source(ctf), folder.c_str(), parameters.get(), BT_LOGGING_LEVEL_NONE,
                                      &source) != BT_GRAPH_ADD_COMPONENT_STATUS_OK ||
        !join(graph, source, muxer))
      return false;
  }
  const bt_component_sink* sink = nullptr;
  return bt_graph_add_simple_sink_component(graph, "review", nullptr, consume, nullptr, &reader, &sink) ==
             BT_GRAPH_ADD_COMPONENT_STATUS_OK &&
         bt_graph_connect_ports(graph, bt_component_filter_borrow_output_port_by_index_const(muxer, 0),
                                bt_component_sink_borrow_input_port_by_index_const(sink, 0),
                                nullptr) == BT_GRAPH_CONNECT_PORTS_STATUS_OK;
}

}  // namespace

std::expected<TraceReading, std::string> read_trace(const std::string& directory,
                                                    const std::function<void(const TraceEvent&)>& visit) {
  auto folders = trace_folders(directory);
  if (!folders) return std::unexpected(folders.error());
  const Plugin ctf = find_plugin("ctf");
  const Plugin utils = find_plugin("utils");
  if (!ctf || !utils)
    return std::unexpected("babeltrace2's plugins ctf and utils are missing: apt-get install libbabeltrace2-0");
  Reader reader(visit);
  const Graph graph(bt_graph_create(0));
  const bool read =
      graph && build(graph.get(), ctf, utils, *folders, reader) && bt_graph_run(graph.get()) == BT_GRAPH_RUN_STATUS_OK;
  if (!read) return std::unexpected(fmt::format("{} cannot be read as a trace: {}", directory, last_error()));
  reader.reading.folders = std::move(*folders);
  return std::move(reader.reading);
}

}  // namespace takt::lab
