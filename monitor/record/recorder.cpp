// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/recorder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "monitor/record/candump.hpp"
#include "monitor/record/frame_log.hpp"
#include "monitor/record/robot_description.hpp"
#include "monitor/record/run_seal.hpp"
#include "monitor/record/standard_messages.hpp"
#include "monitor/record/tick_schema.hpp"

namespace takt::monitor {
namespace {

constexpr Duration kFlushPeriod = milliseconds(500);
constexpr Duration kSegment = seconds(10);
constexpr Duration kSealPeriod = seconds(60);
constexpr Duration kJointStatePeriod = milliseconds(10);
constexpr Duration kTransformsPeriod = milliseconds(40);
constexpr Duration kLatestPicture = seconds(60);  // behind the newest tick
constexpr std::uint64_t kReserveBytes = 1U << 20U;
constexpr std::size_t kChunkBytes = 1U << 20U;  // uncompressed, unless half a second passes first
constexpr std::size_t kFrameTextBytes = 1U << 20U;

std::uint64_t ticks_in(Duration time, Duration tick) {
  return static_cast<std::uint64_t>(std::max<std::int64_t>(time.ns / std::max<std::int64_t>(tick.ns, 1), 1));
}

// Room for the closing words of a full disk. Best effort: on a disk without room for it there is none to keep.
void reserve(const std::string& path) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  if (fd < 0) return;
  (void)::posix_fallocate(fd, 0, kReserveBytes);
  ::close(fd);
}

std::vector<McapTopic> topics_of(const config::RobotConfig& robot) {
  std::vector<McapTopic> topics = run_topics();
  for (const config::Sensor& sensor : robot.sensors)
    if (sensor.image) topics.push_back(picture_topic(sensor.name));
  return topics;
}

// Precondition: the sensor is a camera of the robot.
std::uint16_t picture_channel(const config::RobotConfig& robot, std::uint32_t sensor) {
  const auto before = std::ranges::count_if(std::span(robot.sensors).first(sensor),
                                            [](const config::Sensor& each) { return each.image.has_value(); });
  return static_cast<std::uint16_t>(run_topics().size() + 1 + static_cast<std::size_t>(before));
}

std::map<std::string, std::string> metadata_of(const RunManifest& manifest) {
  return {{"run_id", manifest.run_id},
          {"robot", manifest.robot},
          {"config_sha256", manifest.config_sha256},
          {"log_time", "CLOCK_MONOTONIC + monotonic_to_unix_ns; stamps inside messages are CLOCK_MONOTONIC"},
          {"monotonic_to_unix_ns", std::to_string(manifest.clock.monotonic_to_unix_ns)}};
}

}  // namespace

std::expected<std::unique_ptr<Recorder>, std::string> Recorder::start(const RunFolder& folder, RunManifest manifest,
                                                                      const config::RobotConfig& robot,
                                                                      std::uint64_t max_file_bytes) {
  return make(folder, std::move(manifest), std::make_shared<Watch>(robot), max_file_bytes);
}

std::expected<std::unique_ptr<Recorder>, std::string> Recorder::make(const RunFolder& folder, RunManifest manifest,
                                                                     std::shared_ptr<Watch> watch,
                                                                     std::uint64_t max_file_bytes) {
  if (auto written = replace_file(folder.config(), watch->robot.resolved); !written)
    return std::unexpected(written.error());
  if (auto written = folder.write_manifest(manifest); !written) return std::unexpected(written.error());
  auto ticks = McapWriter::create(folder.ticks(), max_file_bytes, topics_of(watch->robot), metadata_of(manifest));
  if (!ticks) return std::unexpected(ticks.error());
  auto frames = BoundedFile::create(folder.frames(), max_file_bytes);
  if (!frames) return std::unexpected(frames.error());
  auto transitions = BoundedFile::create(folder.transitions(), max_file_bytes);
  if (!transitions) return std::unexpected(transitions.error());
  reserve(folder.reserve());
  return std::unique_ptr<Recorder>(new Recorder(folder, std::move(manifest), std::move(watch), std::move(*ticks),
                                                std::move(*frames), std::move(*transitions)));
}

Recorder::Recorder(const RunFolder& folder, RunManifest manifest, std::shared_ptr<Watch> watch, McapWriter ticks,
                   BoundedFile frames, BoundedFile transitions)
    : folder_(folder),
      watch_(std::move(watch)),
      manifest_(std::move(manifest)),
      ticks_(std::move(ticks)),
      frames_(std::move(frames)),
      transitions_(std::move(transitions)),
      flushed_at_(manifest_.started_at),
      segment_began_(manifest_.started_at),
      sealed_at_(manifest_.started_at),
      joint_state_every_(ticks_in(kJointStatePeriod, watch_->robot.control.period)),
      transforms_every_(ticks_in(kTransformsPeriod, watch_->robot.control.period)) {
  now_ = manifest_.started_at;
  sink_ = {
      .command =
          [this](const RecordedCommand& command) {
            encode_command(command, message_);
            write(Topic::command, now_);
          },
      .tick = [this](const TickRecord& record) { tick(record); },
      .keyframe =
          [this](const RecordedKeyframe& keyframe) {
            encode_keyframe(keyframe, message_);
            write(Topic::keyframe, now_);
          },
      .frame = [this](const FrameRecord& record) { frame(record); },
      .loss = [this](const Loss& lost) { loss(lost); },
      .policy_input =
          [this](const RecordedPolicyInput& input) {
            encode_policy_input(input, message_);
            write(Topic::policy_input, now_);
            if (ticks_.pending_bytes() >= kChunkBytes) flush_ticks();
          },
      .image =
          [this](const ShownImage& image) {
            encode_image(image, message_);
            write(Topic::image, now_);
          },
      .picture = [this](const ShownPicture& shown) { picture(shown); },
  };
  if (!watch_->robot.model) return;
  encode_string(robot_description(watch_->robot), message_);
  write(Topic::robot_description, now_);
}

void Recorder::picture(const ShownPicture& picture) {
  if (picture.sensor >= watch_->robot.sensors.size() || !watch_->robot.sensors[picture.sensor].image) return;
  // The sensor's process says when; no viewer can use one that is off by more than a stall.
  if (picture.sensed_at.ns <= 0 || picture.sensed_at > now_ + kLatestPicture) return;
  encode_compressed_image(watch_->robot.sensors[picture.sensor].name, "png", picture.png, unix_ns(picture.sensed_at),
                          message_);
  write(picture_channel(watch_->robot, picture.sensor), now_);
  if (ticks_.pending_bytes() >= kChunkBytes) flush_ticks();
}

void Recorder::write(std::uint16_t channel, MonoTime at) {
  if (!stop_reason().empty()) return;
  const std::int64_t log_time = std::max<std::int64_t>(unix_ns(at), 0);
  ticks_.write(channel, static_cast<std::uint64_t>(log_time), message_.bytes());
}

void Recorder::tick(const TickRecord& record) {
  now_ = record.header.now;
  if (!stop_reason().empty()) {
    ++manifest_.unrecorded_ticks;
    return;
  }
  encode_tick(record, crc_of(record), message_);
  write(Topic::tick, now_);
  if (manifest_.ticks == 0) manifest_.first_tick = record.header.tick;
  manifest_.last_tick = newest_tick_ = record.header.tick;
  ++manifest_.ticks;
  if (record.header.tick % joint_state_every_ == 0 && record.header.joint_count == manifest_.joints.size()) {
    encode_joint_state(record, unix_ns(now_), manifest_.joints, message_);
    write(Topic::joint_states, now_);
  }
  if (record.header.tick % transforms_every_ == 0 && watch_->robot.model &&
      record.header.joint_count == watch_->robot.joints.size()) {
    encode_tf_message(frame_transforms(watch_->robot, record), unix_ns(now_), message_);
    write(Topic::transforms, now_);
  }
  if (const auto parts = watch_->diagnoser.tick(record)) {
    encode_diagnostic_array(*parts, unix_ns(now_), manifest_.robot, message_);
    write(Topic::diagnostics, now_);
  }
  if (record.header.mode != record.header.previous_mode) transition(record);
  if (record.header.operator_request == OperatorRequest::mark) log(Level::ok, "marked");
  if (ticks_.pending_bytes() >= kChunkBytes) flush_ticks();
}

void Recorder::transition(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  encode_transition({header.tick, header.now, header.previous_mode, header.mode, header.cause}, message_);
  write(Topic::transition, now_);
  const RobotStatus& status = watch_->diagnoser.status();
  const std::string& detail = status.detail;
  const std::string why = status.incident.empty()
                              ? fmt::format("{}{}{}", name(header.cause), detail.empty() ? "" : ": ", detail)
                              : status.incident;
  log(level_of(header.mode), fmt::format("{} -> {}: {}", name(header.previous_mode), name(header.mode), why));
  const nlohmann::ordered_json line{{"tick", header.tick},
                                    {"monotonic_ns", header.now.ns},
                                    {"utc", utc_text(unix_ns(header.now))},
                                    {"from", name(header.previous_mode)},
                                    {"to", name(header.mode)},
                                    {"cause", name(header.cause)},
                                    {"detail", detail},
                                    {"incident", status.incident},
                                    {"age_ns", header.age.total().ns}};
  if (stop_reason().empty() && !transitions_.append(line.dump() + "\n")) stop(transitions_.failure());
}

void Recorder::log(Level level, std::string_view text) {
  encode_log(level, manifest_.robot, text, unix_ns(now_), message_);
  write(Topic::log, now_);
}

void Recorder::frame(const FrameRecord& record) {
  if (!stop_reason().empty()) return;
  const std::string& bus = record.bus < manifest_.buses.size() ? manifest_.buses[record.bus] : "unknown";
  append_candump_line(frame_text_, record, bus, manifest_.clock.monotonic_to_unix_ns);
  if (frame_text_.size() >= kFrameTextBytes) write_frames();
}

void Recorder::write_frames() {
  if (!stop_reason().empty()) return;
  if (frame_text_.empty()) return;
  if (!frames_.append(compressed_frames(frame_text_))) stop(frames_.failure());
  frame_text_.clear();
}

void Recorder::loss(const Loss& lost) {
  const bool stood_by = lost.reason == kStoodBy;
  if (stood_by && lost.ring == "tick" && stop_reason().empty()) {
    manifest_.stood_by_ticks += lost.count;
    newest_tick_ = lost.before_tick - 1;
  }
  if (!stood_by) manifest_.losses[lost.ring + " " + lost.reason] += lost.count;
  if (!stood_by && manifest_.first_losses.size() < kListedLosses) manifest_.first_losses.push_back(lost);
  encode_loss(lost, message_);
  write(Topic::loss, now_);
}

void Recorder::flush_ticks() {
  if (!stop_reason().empty()) return;
  if (!ticks_.flush()) {
    stop(ticks_.file().failure());
    return;
  }
  flushed_ticks_ = manifest_.ticks;
  flushed_tick_ = manifest_.last_tick;
  flushed_through_ = newest_tick_;
}

void Recorder::flush() {
  flush_ticks();
  write_frames();
  for (BoundedFile* file : {&frames_, &transitions_})
    if (!file->sync()) stop(file->failure());
}

void Recorder::flush_if_due(MonoTime now) {
  // The first ticks at once: the executive waits for word that this is a recorder that records.
  const bool is_first = flushed_ticks_ == 0 && manifest_.ticks != 0;
  if (!is_first && now - flushed_at_ < kFlushPeriod) return;
  flushed_at_ = now;
  flush();
  if (now - segment_began_ < kSegment || !stop_reason().empty()) return;
  segment_began_ = now;
  close_segments();
  if (now - sealed_at_ < kSealPeriod) return;
  sealed_at_ = now;
  (void)write_seal(false);  // a disk that has no room for it has none for ticks either, which says so
  ::malloc_trim(0);         // what came and went between what stays would stay with it
}

// Precondition: flushed.
void Recorder::close_segments() {
  for (BoundedFile* const file : {&ticks_.file(), &frames_, &transitions_}) file->close_segment(unix_ns(now_));
}

std::expected<void, std::string> Recorder::write_seal(bool closed) {
  const auto text = run_seal_text(folder_, manifest_.run_id, closed,
                                  {{"ticks.mcap", ticks_.file().sealed()},
                                   {"can.log.zst", frames_.sealed()},
                                   {"transitions.jsonl", transitions_.sealed()}});
  return text ? replace_file(folder_.seal(), *text) : std::unexpected(text.error());
}

void Recorder::drive_cards(std::string_view text) {
  auto json = nlohmann::ordered_json::parse(text, nullptr, false);
  const auto says = [&json](const char* key, std::string_view what) {
    const auto found = json.find(key);
    return found != json.end() && found->is_string() && found->get<std::string>() == what;
  };
  if (!json.is_object() || !says("schema", kDrivesSchema) || !says("config_sha256", manifest_.config_sha256)) return;
  manifest_.drives = std::move(json);
  watch_->cards = text;
  // A disk that has no room for it has none for ticks either, which says so.
  (void)replace_file(folder_.drives(), text);
}

std::uint64_t Recorder::size() const {
  return std::max({ticks_.file().size(), frames_.size(), transitions_.size()});
}

std::expected<std::unique_ptr<Recorder>, std::string> Recorder::begin_next(const RunFolder& folder) {
  flush();
  if (!stop_reason().empty()) return std::unexpected(stop_reason());
  RunManifest manifest = manifest_;
  manifest.run_id = folder.name();
  manifest.goes_on_from = manifest_.run_id;
  manifest.goes_on_from_seal.clear();
  manifest.started_at = now_;
  manifest.ticks = manifest.first_tick = manifest.last_tick = manifest.stood_by_ticks = 0;
  manifest.losses.clear();
  manifest.first_losses.clear();
  auto next = make(folder, std::move(manifest), watch_, kNoLimit);
  if (!next) return next;
  if (!watch_->cards.empty()) (void)replace_file(folder.drives(), watch_->cards);
  manifest_.goes_on_in = folder.name();
  return next;
}

// The chunk that did not fit is gone; what was flushed before is what the run has. The freed reserve takes the loss,
// the index and the manifest.
void Recorder::stop(std::string because) {
  if (!stop_reason().empty()) return;
  std::error_code ignored;
  std::filesystem::remove(folder_.reserve(), ignored);
  manifest_.unrecorded_ticks += manifest_.ticks - flushed_ticks_;
  manifest_.ticks = flushed_ticks_;
  manifest_.last_tick = flushed_tick_;
  ticks_.discard_pending();
  ticks_.file().reopen(ticks_.file().size() + kReserveBytes);
  const Loss stopped{"tick", std::string(kRecordingStopped), 0, flushed_tick_, 0};
  manifest_.first_losses.push_back(stopped);
  encode_loss(stopped, message_);
  write(Topic::loss, now_);
  manifest_.stopped_because = std::move(because);
  (void)ticks_.finish();  // without its index the file still reads from the front
  (void)folder_.write_manifest(manifest_);
}

std::expected<void, std::string> Recorder::finish(MonoTime now, const std::string& because) {
  flush();
  if (stop_reason().empty() && !ticks_.finish()) stop(ticks_.file().failure());
  manifest_.complete = stop_reason().empty();
  manifest_.ended_at = now;
  manifest_.ended_because = because;
  std::error_code ignored;
  std::filesystem::remove(folder_.reserve(), ignored);
  if (auto written = folder_.write_manifest(manifest_); !written) return written;
  close_segments();
  return write_seal(true);
}

}  // namespace takt::monitor
