// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/replay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <utility>

#include "config/printable.hpp"
#include "evidence/review/recorded_input.hpp"
#include "evidence/review/tick_difference.hpp"
#include "executive/contract/version.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/pipeline/control_tick.hpp"

namespace takt::evidence {
namespace {

std::string where_of(const FieldPlace& place, const monitor::RunManifest& manifest) {
  switch (place.group) {
    case FieldPlace::Group::header:
      return {};
    case FieldPlace::Group::bus:
      return place.index < manifest.buses.size() ? manifest.buses[place.index] : fmt::format("bus {}", place.index);
    case FieldPlace::Group::joint:
      return place.index < manifest.joints.size() ? manifest.joints[place.index] : fmt::format("joint {}", place.index);
  }
  return {};
}

std::string made_by_other_sources(const nlohmann::ordered_json& executive) {
  const auto text = [&](const char* key) {
    const auto found = executive.find(key);
    return found != executive.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  if (!executive.is_object()) return {};
  const std::string sources = text("source_sha256");
  return sources.empty() || sources == source_sha256() ? "" : config::printable(text("version"));
}

class Replayer {
 public:
  Replayer(const monitor::RecordedRun& run, std::uint64_t from, std::uint64_t start_behind)
      : run_(run),
        config_(recorded_config(run)),
        state_(pipeline::make_tick_state(config_)),
        from_(from),
        start_behind_(start_behind),
        is_of_other_build_(!made_by_other_sources(run.manifest.executive).empty()),
        ready_(start_behind == 0) {}

  // What the run's ticks lack is no part of the comparison; empty: they can be replayed, else half a sentence.
  std::string adapt(const monitor::OtherTickLayout& layout) {
    is_of_other_build_ = true;
    if (!layout.unknown.empty()) return fmt::format("hold `{}`, which this version does not know", layout.unknown[0]);
    for (const std::string& name : layout.lacking) {
      const auto is_named = [&](const monitor::TickField& field) { return field.name == name; };
      for (const auto& [fields, of_joints] : {std::pair{monitor::header_fields(), false},
                                              {monitor::bus_fields(), false},
                                              {monitor::joint_fields(), true}}) {
        const auto field = std::ranges::find_if(fields, is_named);
        if (field == fields.end()) continue;
        if (field->role == monitor::FieldRole::input) return fmt::format("lack `{}`, which decides", name);
        (of_joints ? lacking_of_joints_ : lacking_).push_back(*field);
        report_.not_compared.push_back(name);
      }
    }
    return {};
  }

  void command(const monitor::RecordedCommand& command) {
    if (command.tick <= start_behind_) return;
    if (monitor::crc_of(command) == command.crc) return input_.command(command);
    monitor::RecordedCommand mended = command;
    const auto field = monitor::mend_flipped_bit(mended);
    note({command.tick, field ? "command " + *field : "command (more than one bit altered)", {}, {}, {}, true});
    altered_tick_ = command.tick;
    if (field) input_.command(mended);
  }

  void tick(const monitor::RecordedTick& recorded) {
    ++read_;
    const std::uint64_t number = recorded.record.header.tick;
    report_.last_tick = number;
    if (number <= start_behind_) return;
    if (number >= from_) ++report_.ticks;
    monitor::RecordedTick tick = recorded;
    const bool whole = monitor::crc_of(recorded.record) == recorded.crc || mend(tick);
    if (tick.record.header.tick != at_ + 1) lose_track();
    const pipeline::TickInput* input = input_.of(tick.record);
    if (input == nullptr) lose_track();
    if (number >= from_ && input_.is_by_header()) ++report_.by_header;
    at_ = tick.record.header.tick;
    if (!ready_) {
      if (number >= from_) ++report_.not_judged;
      return;
    }
    if (report_.started_at == 0 && number >= from_) report_.started_at = number;
    pipeline::control_tick(*state_, *input, config_, *output_);
    leave_out(tick.record);
    if (!whole || !is_equal(tick.record)) {
      blame(tick.record, !whole);
      ready_ = false;
    }
    if (number < from_) return;
    // A corrected bit leaves a tick that reproduces, but not the one in the file.
    if (altered_tick_ == number || !ready_) {
      ++report_.mismatches;
    } else {
      ++report_.identical;
    }
  }

  std::expected<void, std::string> keyframe(const monitor::RecordedKeyframe& keyframe) {
    if (keyframe.tick < start_behind_) return {};
    if (ready_ && is_of_other_build_ && !pipeline::is_of_this_layout(keyframe.state)) return {};
    if (ready_ && keyframe.tick == at_ && is_state(keyframe)) return {};
    if (auto loaded = pipeline::load(*state_, config_, keyframe.state); !loaded) return loaded;
    at_ = keyframe.tick;
    ready_ = true;
    return {};
  }

  [[nodiscard]] ReplayReport take_report() {
    report_.missing = monitor::missing_ticks(run_.manifest, read_);
    report_.unrecorded = run_.manifest.unrecorded_ticks;
    report_.stopped_because = run_.manifest.stopped_because;
    return std::move(report_);
  }

 private:
  // Puts a single flipped bit right, so that the ticks behind it can still be judged.
  bool mend(monitor::RecordedTick& tick) {
    TickRecord mended;
    const auto place = locate_flipped_bit(tick, mended);
    if (!place) return false;
    note({tick.record.header.tick, std::string(place->field->name), where_of(*place, run_.manifest),
          value_text(tick.record, *place), value_text(mended, *place), true});
    altered_tick_ = tick.record.header.tick;
    tick.record = mended;
    return true;
  }

  // Of the recomputed tick: what the recorded one does not have.
  void leave_out(const TickRecord& recorded) {
    const auto copy = [](const monitor::TickField& field, const auto& from, auto& to) {
      const auto bytes = std::as_bytes(std::span(&from, 1)).subspan(field.offset, monitor::size_of(field.type));
      std::ranges::copy(bytes,
                        std::as_writable_bytes(std::span(&to, 1)).begin() + static_cast<std::ptrdiff_t>(field.offset));
    };
    for (const monitor::TickField& field : lacking_) copy(field, recorded.header, output_->record.header);
    for (const monitor::TickField& field : lacking_of_joints_)
      for (std::size_t j = 0; j < std::min<std::size_t>(recorded.header.joint_count, kMaxJoints); ++j)
        copy(field, recorded.joints[j], output_->record.joints[j]);
  }

  void lose_track() {
    if (ready_ && at_ != 0) ++report_.gaps;
    ready_ = false;
  }

  [[nodiscard]] bool is_equal(const TickRecord& recorded) const {
    return recorded.header.joint_count == output_->record.header.joint_count &&
           std::memcmp(&recorded, &output_->record, recorded.used_bytes()) == 0;
  }

  void blame(const TickRecord& recorded, bool altered) {
    const auto place = first_difference(recorded, output_->record);
    if (!place) {
      note({recorded.header.tick, "reserved bytes", {}, {}, {}, altered});
      return;
    }
    note({recorded.header.tick, std::string(place->field->name), where_of(*place, run_.manifest),
          value_text(recorded, *place), value_text(output_->record, *place), altered});
  }

  bool is_state(const monitor::RecordedKeyframe& keyframe) {
    saved_.resize(ipc::kMaxKeyframeBytes);
    saved_.resize(pipeline::save(*state_, saved_));
    const bool equal = saved_ == keyframe.state;
    if (equal) {
      ++report_.keyframes;
    } else {
      ++report_.mismatches;
      note({keyframe.tick, "keyframe", {}, {}, {}, false});
    }
    return equal;
  }

  void note(Mismatch mismatch) {
    if (mismatch.tick >= from_ && !report_.first) report_.first = std::move(mismatch);
  }

  const monitor::RecordedRun& run_;
  pipeline::TickConfig config_;
  pipeline::TickStatePtr state_;
  std::unique_ptr<pipeline::TickOutput> output_ = std::make_unique<pipeline::TickOutput>();
  RecordedInput input_;
  monitor::Bytes saved_;
  ReplayReport report_;
  std::uint64_t from_, start_behind_;
  std::uint64_t read_ = 0;                                       // ticks in the file
  std::uint64_t at_ = 0;                                         // tick the state is behind
  std::uint64_t altered_tick_ = 0;                               // newest tick whose record or command was altered
  std::vector<monitor::TickField> lacking_, lacking_of_joints_;  // outputs
  bool is_of_other_build_;
  bool ready_;  // the state is the one behind tick at_
};

// Last keyframe before `from`; 0 when replay can, or must, begin with the file.
std::expected<std::uint64_t, std::string> start_behind(const monitor::RecordedRun& run, std::uint64_t from) {
  std::uint64_t keyframe = 0;
  const auto scanned = monitor::scan_run(run, {.tick = {},
                                               .command = {},
                                               .keyframe =
                                                   [&](const monitor::RecordedKeyframe& each) {
                                                     if (each.tick < from) keyframe = std::max(keyframe, each.tick);
                                                   },
                                               .loss = {}});
  if (!scanned) return std::unexpected(scanned.error());
  return keyframe;
}

}  // namespace

std::expected<ReplayReport, std::string> replay(const monitor::RecordedRun& run, std::uint64_t from) {
  std::uint64_t behind = 0;
  if (from > 1) {
    const auto found = start_behind(run, from);
    if (!found) return std::unexpected(found.error());
    behind = *found;
  }
  Replayer replayer(run, from, behind);
  std::string refusal, other_ticks;
  const auto scanned = monitor::scan_run(
      run,
      {.tick = [&](const monitor::RecordedTick& tick) { replayer.tick(tick); },
       .command = [&](const monitor::RecordedCommand& command) { replayer.command(command); },
       .keyframe =
           [&](const monitor::RecordedKeyframe& keyframe) {
             const auto loaded = replayer.keyframe(keyframe);
             if (!loaded) refusal = loaded.error();
           },
       .loss = {},
       .other_tick_layout = [&](const monitor::OtherTickLayout& layout) { other_ticks = replayer.adapt(layout); }});
  if (!scanned) return std::unexpected(scanned.error());
  if (!other_ticks.empty())
    return std::unexpected(
        fmt::format("{} cannot be replayed bit for bit: its ticks {} ({}); the version that made it can",
                    run.folder.path(), other_ticks, monitor::whose(run.manifest.executive)));
  ReplayReport report = replayer.take_report();
  report.file = scanned->file;
  report.made_by = made_by_other_sources(run.manifest.executive);
  // No record of another layout is of these sources.
  if (report.made_by.empty() && scanned->is_of_other_layout) report.made_by = "of an unknown version";
  if (report.identical + report.mismatches == 0 && !refusal.empty()) return std::unexpected(refusal);
  return report;
}

}  // namespace takt::evidence
