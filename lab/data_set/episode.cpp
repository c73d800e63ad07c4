// SPDX-License-Identifier: Apache-2.0
#include "lab/data_set/episode.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <memory>
#include <optional>
#include <span>

#include "config/action_target.hpp"

namespace takt::data_set {
namespace {

std::string name(config::ActionKind kind) {
  switch (kind) {
    case config::ActionKind::joint_position:
      return "joint positions";
    case config::ActionKind::joint_velocity:
      return "joint velocities";
    case config::ActionKind::joint_torque:
      return "joint torques";
  }
  return "invalid";
}

constexpr std::string_view kAltered = "was altered since it was recorded (its checksum does not match)";
constexpr std::string_view kNoExecutives = "is none that an executive accepts";

// Follows a recording and cuts it into episodes. Its counts are believed once they were compared with what is there: a
// checksum says that a record is as it was written, not who wrote it.
class EpisodeCutter {
 public:
  explicit EpisodeCutter(const config::RobotConfig& robot)
      : joints_(robot.joints.size()),
        period_(robot.policy->period),
        field_(config::target_of(robot.policy->action.kind).field) {
    for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
      if (!robot.joints[joint].passive) acting_.push_back(joint);
  }
  void command(const monitor::RecordedCommand& command);
  void tick(const monitor::RecordedTick& tick);
  void end_episode() { previous_.reset(); }

  std::vector<Episode> episodes;
  std::uint64_t observations = 0;
  // Why nothing can be made of the recording, and of which record, in words; empty: there is no reason.
  std::string wrong;

 private:
  struct Published {
    std::uint64_t tick = 0, id = 0, policy = 0;
    MonoTime at;
  };
  // The command that this tick played; nullptr: it is not in the recording.
  const CommandChunk* in_use(const TickRecordHeader& header);
  void accept();
  void frame(const TickRecord& record, const CommandChunk& chunk);
  [[nodiscard]] bool follows(const Published& now) const;

  std::size_t joints_;
  Duration period_;
  CommandField field_;
  std::vector<std::size_t> acting_;
  std::optional<monitor::RecordedCommand> read_;        // by the next tick
  std::deque<std::unique_ptr<CommandChunk>> accepted_;  // from the one in use on
  std::uint64_t last_tick_ = 0;
  std::optional<Published> previous_;  // of the episode that goes on
};

void EpisodeCutter::command(const monitor::RecordedCommand& command) {
  if (command.sender != Player::policy || !wrong.empty()) return;
  if (crc_of(command) != command.crc) wrong = fmt::format("the command that tick {} read {}", command.tick, kAltered);
  read_ = command;
}

void EpisodeCutter::accept() {
  auto chunk = std::make_unique<CommandChunk>();
  std::memcpy(chunk.get(), read_->payload.data(), std::min(read_->payload.size(), sizeof(CommandChunk)));
  const CommandHeader& header = chunk->header;
  const bool is_whole = read_->payload.size() >= sizeof header && header.joint_count == joints_ &&
                        header.step_count >= 1 && header.step_count <= kMaxChunkSteps &&
                        read_->payload.size() == chunk->used_bytes();
  if (!is_whole) wrong = fmt::format("the command that tick {} read {}", read_->tick, kNoExecutives);
  accepted_.push_back(std::move(chunk));
}

const CommandChunk* EpisodeCutter::in_use(const TickRecordHeader& header) {
  if (read_ && read_->tick == header.tick && header.seats[Seat::policy].arrival == Arrival::accepted) accept();
  read_.reset();
  // Sequences start over with every session of a policy, and every policy has its own: the newest of that number and
  // policy is the one.
  const auto found = std::find_if(accepted_.rbegin(), accepted_.rend(), [&](const auto& chunk) {
    return chunk->header.sequence == header.seats[Seat::policy].command_sequence &&
           chunk->header.policy_hash == header.command_policy;
  });
  if (found == accepted_.rend()) return nullptr;
  accepted_.erase(accepted_.begin(), found.base() - 1);
  return accepted_.front().get();
}

bool EpisodeCutter::follows(const Published& now) const {
  if (!previous_ || now.id != previous_->id + 1 || now.policy != previous_->policy) return false;
  return std::abs((now.at - previous_->at - period_).ns) * 2 <= period_.ns;
}

void EpisodeCutter::tick(const monitor::RecordedTick& tick) {
  const TickRecordHeader& header = tick.record.header;
  if (!wrong.empty()) return;
  if (monitor::crc_of(tick.record) != tick.crc) wrong = fmt::format("tick {} {}", header.tick, kAltered);
  if (header.joint_count != joints_) wrong = fmt::format("tick {} is of {} joints", header.tick, header.joint_count);
  if (!wrong.empty()) return;
  if (header.tick != last_tick_ + 1) end_episode();
  last_tick_ = header.tick;
  const CommandChunk* chunk = in_use(header);
  if (wrong.empty() && chunk != nullptr && header.chunk_step >= chunk->header.step_count)
    wrong = fmt::format("tick {} plays step {} of {}", header.tick, header.chunk_step, chunk->header.step_count);
  if (!wrong.empty()) return;
  observations += header.observation_published != 0 ? 1 : 0;
  if (header.mode != Mode::tracking || header.player != Player::policy || chunk == nullptr) return end_episode();
  if (header.observation_published == 0) return;
  const Published published{header.tick, header.observation_published, header.command_policy, header.now};
  if (!follows(published)) {
    Episode& begun = episodes.emplace_back();
    begun.policy = header.command_policy;
    begun.first_tick = header.tick;
  }
  previous_ = published;
  frame(tick.record, *chunk);
}

void EpisodeCutter::frame(const TickRecord& record, const CommandChunk& chunk) {
  Episode& episode = episodes.back();
  episode.last_tick = record.header.tick;
  ++episode.frames;
  const std::span joints(record.joints, record.header.joint_count);
  for (const JointRecord& joint : joints) episode.states.push_back(joint.q_estimate);
  for (const JointRecord& joint : joints) episode.states.push_back(joint.dq_estimate);
  // What a command leaves out is zero (executive/contract/command_chunk.hpp); q it cannot leave out.
  const bool is_there = (chunk.header.fields & static_cast<unsigned>(field_)) != 0;
  for (const std::size_t joint : acting_) {
    const std::size_t place = value_index(chunk.header, field_, record.header.chunk_step, joint);
    episode.actions.push_back(is_there ? chunk.values[place] : 0.0F);
  }
}

Robot robot_of(const config::RobotConfig& config) {
  Robot robot{config.robot, {}, {}, config.policy->period, config.policy->action.kind, {}};
  for (const config::Joint& joint : config.joints) {
    robot.joints.push_back(joint.name);
    if (joint.kind == config::JointKind::slide) robot.slides.push_back(joint.name);
    if (!joint.passive) robot.acting_joints.push_back(joint.name);
  }
  return robot;
}

}  // namespace

std::expected<RunEpisodes, std::string> episodes_of(const monitor::RecordedRun& run) {
  const std::string& path = run.folder.path();
  if (!run.robot.policy)
    return std::unexpected(
        fmt::format("{}: robot {} has no policy: there is no action to learn", path, run.robot.robot));
  EpisodeCutter cutter(run.robot);
  const auto scan = scan_run(run, {.tick = [&](const monitor::RecordedTick& tick) { cutter.tick(tick); },
                                   .command = [&](const monitor::RecordedCommand& command) { cutter.command(command); },
                                   .keyframe = {},
                                   .loss = {}});
  if (!scan) return std::unexpected(scan.error());
  if (!cutter.wrong.empty())
    return std::unexpected(fmt::format("{}: {}; takt replay {} says where", path, cutter.wrong, path));
  if (cutter.episodes.empty()) {
    return std::unexpected(
        fmt::format("{}: in no tick did the robot track a command of its policy: there is nothing to export", path));
  }
  return RunEpisodes{
      .run_id = run.manifest.run_id,
      .config_sha256 = run.manifest.config_sha256,
      .policy_sha256 = run.manifest.policy_sha256,
      .robot = robot_of(run.robot),
      .observations = cutter.observations,
      .unreadable = scan->undecodable + scan->file.damaged_chunks + (scan->file.unread_bytes != 0 ? 1 : 0),
      .episodes = std::move(cutter.episodes)};
}

std::string difference(const Robot& one, const Robot& other) {
  const auto of = [](std::string_view what, const std::string& mine, const std::string& theirs) {
    return fmt::format("one is of {} {}, the other of {}", what, mine, theirs);
  };
  const auto joints = [](const Robot& robot) { return fmt::format("{}", fmt::join(robot.joints, ", ")); };
  const auto slides = [](const Robot& robot) {
    return robot.slides.empty() ? "none" : fmt::format("{}", fmt::join(robot.slides, ", "));
  };
  const auto period = [](const Robot& robot) {
    return fmt::format("{} ms", static_cast<double>(robot.period.ns) * 1e-6);
  };
  if (one.name != other.name) return of("robot", one.name, other.name);
  if (one.joints != other.joints || one.acting_joints != other.acting_joints)
    return of("joints", joints(one), joints(other));
  if (one.slides != other.slides) return of("slides", slides(one), slides(other));
  if (one.period != other.period) return of("a policy with period", period(one), period(other));
  if (one.action != other.action) return of("actions that are", name(one.action), name(other.action));
  return "";
}

}  // namespace takt::data_set
