// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/recorded_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "config/load.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/message_schema.hpp"
#include "monitor/record/tick_words.hpp"

namespace takt::monitor {

std::expected<RecordedRun, std::string> open_run(const std::string& directory) {
  RecordedRun run{RunFolder(directory), {}, {}};
  auto manifest = run.folder.read_manifest();
  if (!manifest) return std::unexpected(manifest.error());
  run.manifest = std::move(*manifest);
  const auto text = read_file(run.folder.config());
  if (!text) return std::unexpected(text.error());
  if (const std::string found = config::sha256_hex(*text); found != run.manifest.config_sha256) {
    return std::unexpected(fmt::format("{} was altered: its SHA-256 is {}, the manifest says {}", run.folder.config(),
                                       found, run.manifest.config_sha256));
  }
  // The manifest of a recording that was cut off is older than the cards.
  if (const auto cards = read_file(run.folder.drives()))
    if (auto json = nlohmann::ordered_json::parse(*cards, nullptr, false); json.is_object())
      run.manifest.drives = std::move(json);
  auto robot = config::parse_recorded(*text, run.folder.config());
  if (!robot) {
    const std::string first = robot.error().substr(0, robot.error().find('\n'));
    return std::unexpected(fmt::format("{} ({})", first, whose(run.manifest.executive)));
  }
  run.robot = std::move(*robot);
  return run;
}

namespace {

constexpr std::array kTopicsRead{Topic::tick, Topic::command,      Topic::keyframe,
                                 Topic::loss, Topic::policy_input, Topic::image};

class RunScan {
 public:
  explicit RunScan(const RunVisitor& visitor) : visitor_(visitor) {
    for (const McapTopic& topic : run_topics())
      for (const Topic one : kTopicsRead)
        if (topic.topic == topic_name(one)) topics_.push_back({.topic = one, .wanted = topic});
  }
  ScanReport report;
  std::string refusal;

  // False: the rest cannot be read either.
  bool message(const McapMessage& message) {
    const auto found =
        std::ranges::find(topics_, message.topic, [](const Reading& one) { return topic_name(one.topic); });
    if (found == topics_.end() || !is_wanted(found->topic)) return true;
    Reading& reading = *found;
    if (!reading.relayout && !describe(reading, message)) return false;
    if (reading.schema.data() != message.schema.data() && reading.schema != message.schema)
      return refuse(reading, "is described twice, and otherwise");
    const auto data = reading.relayout->is_needed() ? (*reading.relayout)(message.data) : message.data;
    if (!hand_on(reading, data)) ++report.undecodable;
    return refusal.empty();
  }

  void finish(std::uint64_t recorded) {
    if (refusal.empty() && ticks_ == 0 && unread_ticks_ != 0 && recorded != 0)
      refusal = fmt::format("has {} messages of {}, and none is a tick", unread_ticks_, topic_name(Topic::tick));
  }

 private:
  struct Reading {
    Topic topic;
    McapTopic wanted;
    std::string_view schema{};  // that `relayout` is of
    std::optional<Relayout> relayout{};
  };

  [[nodiscard]] bool is_wanted(Topic topic) const {
    return (topic == Topic::tick && visitor_.tick) || (topic == Topic::command && visitor_.command) ||
           (topic == Topic::keyframe && visitor_.keyframe) || (topic == Topic::loss && visitor_.loss) ||
           (topic == Topic::policy_input && visitor_.policy_input) || (topic == Topic::image && visitor_.image);
  }

  bool describe(Reading& reading, const McapMessage& message) {
    auto recorded = message_schema_of(message.schema);
    auto wanted = message_schema_of(reading.wanted.schema);
    if (!recorded) return refuse(reading, recorded.error());
    if (reading.topic == Topic::tick) {
      const auto has = [&](std::string_view field) {
        return std::ranges::find(recorded->fields, field, &MessageField::name) != recorded->fields.end();
      };
      for (const std::string_view needed : {"now", "mode", "joint_count", "bus_count"})
        if (!has(needed)) return refuse(reading, fmt::format("lacks `{}`", needed));
      only_policy_plays_ = !has("player");
      words_.emplace(*recorded);
      report.is_of_other_layout |= words_->differ();
      if (visitor_.other_tick_layout) tell_other_layout(recorded->fields, wanted->fields);
    }
    auto relayout = Relayout::make(std::move(*recorded), std::move(wanted.value()));
    if (!relayout) return refuse(reading, relayout.error());
    reading.relayout = std::move(*relayout);
    reading.schema = message.schema;
    report.is_of_other_layout |= reading.topic == Topic::tick && reading.relayout->is_needed();
    return true;
  }

  void tell_other_layout(const std::vector<MessageField>& recorded, const std::vector<MessageField>& wanted) const {
    const auto beyond = [](const std::vector<MessageField>& these, const std::vector<MessageField>& those) {
      std::vector<std::string> names;
      for (const MessageField& field : these)
        if (std::ranges::find(those, field.name, &MessageField::name) == those.end()) names.push_back(field.name);
      return names;
    };
    OtherTickLayout layout{beyond(wanted, recorded), beyond(recorded, wanted)};
    if (!layout.lacking.empty() || !layout.unknown.empty()) visitor_.other_tick_layout(layout);
  }

  bool refuse(const Reading& reading, const std::string& why) {
    refusal = fmt::format("{} {}", topic_name(reading.topic), why);
    return false;
  }

  bool tick(const Reading& reading, std::span<const std::byte> data) {
    if (!decode_tick(data, tick_)) {
      ++unread_ticks_;
      return false;
    }
    ++ticks_;
    if (words_->differ())
      if (const auto done = words_->translate(tick_.record); !done)
        return refuse(reading, fmt::format("has {} in tick {}, which this version does not know", done.error(),
                                           tick_.record.header.tick));
    TickRecordHeader& header = tick_.record.header;
    if (only_policy_plays_ && header.mode == Mode::tracking && is_usable(header.seats[Seat::policy].freshness))
      header.player = Player::policy;
    // It was made of bytes that lay otherwise.
    if (report.is_of_other_layout) tick_.crc = crc_of(tick_.record);
    visitor_.tick(tick_);
    return true;
  }

  // False: the message is not what its topic says.
  bool hand_on(const Reading& reading, std::span<const std::byte> data) {
    const auto decoded = [&](auto message, auto decode, const auto& visit) {
      if (!decode(data, message)) return false;
      visit(message);
      return true;
    };
    switch (reading.topic) {
      case Topic::tick:
        return tick(reading, data);
      case Topic::command:
        return decoded(RecordedCommand{}, decode_command, visitor_.command);
      case Topic::keyframe:
        return decoded(RecordedKeyframe{}, decode_keyframe, visitor_.keyframe);
      case Topic::loss:
        return decoded(Loss{}, decode_loss, visitor_.loss);
      case Topic::policy_input:
        return decoded(RecordedPolicyInput{}, decode_policy_input, visitor_.policy_input);
      case Topic::image:
        return decoded(ShownImage{}, decode_image, visitor_.image);
      case Topic::transition:
      case Topic::joint_states:
      case Topic::diagnostics:
      case Topic::robot_description:
      case Topic::transforms:
      case Topic::log:
        break;
    }
    return true;
  }

  const RunVisitor& visitor_;
  std::vector<Reading> topics_;
  std::optional<TickWords> words_;
  bool only_policy_plays_ = false;  // of a run from before there was a fallback policy
  RecordedTick tick_;
  std::uint64_t ticks_ = 0, unread_ticks_ = 0;
};

}  // namespace

std::expected<ScanReport, std::string> scan_run(const RecordedRun& run, const RunVisitor& visitor) {
  const auto reader = McapReader::open(run.folder.ticks());
  if (!reader) return std::unexpected(reader.error());
  RunScan scan(visitor);
  scan.report.file = reader->scan([&](const McapMessage& message) { return scan.message(message); });
  scan.finish(run.manifest.ticks);
  if (!scan.refusal.empty())
    return std::unexpected(fmt::format("{}: {} ({})", run.folder.ticks(), scan.refusal, whose(run.manifest.executive)));
  return scan.report;
}

}  // namespace takt::monitor
