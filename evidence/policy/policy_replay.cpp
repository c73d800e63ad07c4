// SPDX-License-Identifier: Apache-2.0
#include "evidence/policy/policy_replay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <tuple>
#include <utility>

#include "config/action_target.hpp"
#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "executive/ipc/crc32c.hpp"
#include "monitor/record/image_file.hpp"
#include "policy_host/chunk_builder.hpp"
#include "policy_host/chunk_mixer.hpp"
#include "policy_host/observation_builder.hpp"
#include "policy_host/onnx_policy.hpp"
#include "policy_host/policy_fit.hpp"

namespace takt::evidence {
namespace {

using Why = PolicyReplayRefusal::Why;

std::unexpected<PolicyReplayRefusal> refused(Why why, std::string sentence) {
  return std::unexpected(PolicyReplayRefusal{why, std::move(sentence)});
}

// What a command asks for, whenever it was sent.
std::uint32_t content_of(const CommandHeader& header, std::span<const std::byte> values) {
  const std::uint64_t shape[] = {header.policy_hash, static_cast<std::uint64_t>(header.step_period.ns),
                                 header.step_count, header.joint_count, header.fields};
  return ipc::crc32c(values, ipc::crc32c(std::as_bytes(std::span(shape))));
}

std::string place_in(const monitor::PolicyInput& input, std::size_t at) {
  const std::size_t samples_at = sizeof(PolicyInputHeader);
  std::size_t from = samples_at + input.samples.size() * sizeof(PolicyInputSample);
  if (at < samples_at) return "its header";
  if (at < from) return "the stamps of its samples";
  const std::pair<const char*, const std::vector<float>*> parts[] = {
      {"q", &input.joints[0]},          {"dq", &input.joints[1]},          {"tau", &input.joints[2]},
      {"q_setpoint", &input.joints[3]}, {"dq_of_drive", &input.joints[4]}, {"sample_values", &input.sample_values},
      {"input", &input.input},          {"output", &input.output}};
  for (const auto& [name, values] : parts) {
    if (at < from + 4 * values->size()) return fmt::format("{}[{}]", name, (at - from) / 4);
    from += 4 * values->size();
  }
  return "its end";
}

// When one flipped bit explains a checksum that does not match: puts it right and names its place.
std::optional<std::string> mend(monitor::RecordedPolicyInput& recorded) {
  constexpr std::size_t kSearchedBytes = 4096;  // the search is quadratic in the size
  monitor::Bytes payload = monitor::packed(recorded.input);
  if (payload.size() > kSearchedBytes) return std::nullopt;
  for (std::size_t bit = 0; bit < 8 * payload.size(); ++bit) {
    const std::byte mask{static_cast<unsigned char>(1U << (bit % 8))};
    payload[bit / 8] ^= mask;
    if (ipc::crc32c(payload) == recorded.crc) {
      auto mended = monitor::read_policy_input(payload);
      if (!mended) return std::nullopt;
      std::string place = place_in(recorded.input, bit / 8);
      recorded.input = std::move(*mended);
      return place;
    }
    payload[bit / 8] ^= mask;
  }
  return std::nullopt;
}

// The run's images, by what inputs say of them.
class RunImages {
 public:
  explicit RunImages(monitor::RunFolder folder) : folder_(std::move(folder)) {}
  void add(const monitor::ShownImage& image) {
    images_[{image.sensor, image.sequence, image.published_at.ns, image.sensed_at.ns}] = image;
  }
  // Its bytes, or why they are not there. The newest of each sensor stays in memory: several answers rest on it.
  std::expected<std::vector<std::uint8_t>, std::string> bytes_of(const PolicyInputSample& sample) {
    const auto found = images_.find({sample.sensor, sample.sequence, sample.published_at.ns, sample.sensed_at.ns});
    if (found == images_.end() || found->second.sha256.empty())
      return std::unexpected("the recorder never had its image " + std::to_string(sample.sequence));
    const monitor::ShownImage& image = found->second;
    auto& [sha256, bytes] = newest_[sample.sensor];
    if (sha256 == image.sha256) return bytes;
    if (image.file != monitor::ImageFile::stored)
      return std::unexpected(fmt::format("image {} went without a file: {}", image.sha256, name(image.file)));
    auto read = monitor::read_image(folder_, image.shape, image.sha256);
    if (read) {
      sha256 = image.sha256;
      bytes = *read;
    }
    return read;
  }

 private:
  monitor::RunFolder folder_;
  std::map<std::tuple<std::uint32_t, std::uint64_t, std::int64_t, std::int64_t>, monitor::ShownImage> images_;
  std::map<std::uint32_t, std::pair<std::string, std::vector<std::uint8_t>>> newest_;
};

// One policy's answers, one after the other.
class Replayer {
 public:
  static std::expected<std::unique_ptr<Replayer>, PolicyReplayRefusal> make(config::RobotConfig robot, Player sender,
                                                                            const PolicyReplayOptions& options,
                                                                            RunImages& images);
  // Why it cannot be replayed; empty: it was.
  std::string answer(monitor::RecordedPolicyInput recorded);
  void command(const monitor::RecordedCommand& recorded);
  void lost(const monitor::Loss& loss) {
    (loss.reason == monitor::kStoodBy ? stood_by_
     : loss.reason == "before_attach" ? result_.before
                                      : result_.lost) += loss.count;
  }
  PolicyReplay finish();
  [[nodiscard]] Player sender() const { return result_.sender; }

 private:
  Replayer(config::RobotConfig robot, std::unique_ptr<policy_host::Policy> policy, bool remembers, RunImages& images)
      : robot_(std::move(robot)),
        policy_(std::move(policy)),
        remembers_(remembers),
        images_(images),
        observation_(robot_),
        builder_(robot_, 0),
        joints_(robot_.joints.size()) {
    for (const policy_host::ImagePlace& place : observation_.image_places()) values_of_images_ += place.width;
  }
  [[nodiscard]] std::string unfit(const monitor::PolicyInput& input) const;
  bool put_images(monitor::PolicyInput& input);
  bool follow(const monitor::PolicyInput& input);
  void judge(const monitor::PolicyInput& input);
  void measure(const monitor::PolicyInput& input);
  void expect_command(const monitor::PolicyInput& input);
  void fill(CommandChunk& chunk, const monitor::PolicyInput& input, std::span<const float> outputs) const;
  void settle(std::uint32_t answered, std::uint32_t read);

  struct Sum {
    double largest = 0, squares = 0;
    std::uint64_t values = 0;
  };
  using Key = std::pair<std::uint64_t, std::uint64_t>;  // observation, sequence

  config::RobotConfig robot_;
  std::unique_ptr<policy_host::Policy> policy_;
  bool remembers_;  // hidden state, or a count of its inferences
  RunImages& images_;
  policy_host::ObservationBuilder observation_;  // for where images stand in the input
  std::size_t values_of_images_ = 0;
  bool is_other_ = false;
  double tolerance_ = 0;
  policy_host::ChunkBuilder builder_;
  std::unique_ptr<CommandChunk> recorded_ = std::make_unique<CommandChunk>();
  std::unique_ptr<CommandChunk> recomputed_ = std::make_unique<CommandChunk>();
  std::vector<float> output_;
  std::vector<Sum> joints_;
  std::uint64_t last_inference_ = 0;
  std::uint64_t stood_by_ = 0;  // answers left out of quiet standby
  bool state_known_ = false;
  std::map<Key, std::uint32_t> answered_, read_;  // contents that wait for their counterpart
  PolicyReplay result_;
};

std::expected<std::unique_ptr<Replayer>, PolicyReplayRefusal> Replayer::make(config::RobotConfig robot, Player sender,
                                                                             const PolicyReplayOptions& options,
                                                                             RunImages& images) {
  config::Policy& section = *robot.policy;
  if (!options.with.empty()) section.file = options.with;
  if (const auto fine = policy_host::check_policy_section(robot); !fine) return refused(Why::policy, fine.error());
  const auto hash = config::policy_hash(section.file);
  if (!hash) return refused(Why::policy, hash.error());
  auto policy = policy_host::load_robot_policy(robot);
  if (!policy) return refused(Why::policy, policy.error());
  if (const auto fits = policy_host::check_fit(robot, **policy); !fits) return refused(Why::policy, fits.error());

  const bool remembers = (*policy)->is_recurrent();
  std::unique_ptr<Replayer> made(new Replayer(std::move(robot), std::move(*policy), remembers, images));
  made->is_other_ = !options.with.empty();
  made->tolerance_ = options.tolerance;
  made->output_.resize(made->policy_->output_size());
  made->result_.sender = sender;
  made->result_.is_mixed = policy_host::mixes_answers(made->robot_.policy->action.join.kind);
  made->result_.file = made->robot_.policy->file;
  made->result_.hash = *hash;
  made->result_.unit =
      config::unit_of_joints(made->robot_, {}, config::target_of(made->robot_.policy->action.kind).quantity);
  return made;
}

std::string Replayer::unfit(const monitor::PolicyInput& input) const {
  const std::size_t places = observation_.image_places().size();
  if (!is_other_ && input.header.built_in == 0)
    return "its answers come from a plugin engine, which cannot be run here; compare an ONNX file by "
           "--with";
  if (!is_other_ && input.header.policy_hash != result_.hash)
    return fmt::format(
        "{} has the hash {:016x}, the run's policy had {:016x}: put the run's file back, or compare this one by --with",
        result_.file, result_.hash, input.header.policy_hash);
  if (input.input.size() + values_of_images_ != policy_->input_size() ||
      input.output.size() != policy_->output_size() || input.q().size() != robot_.joints.size() ||
      input.samples.size() < places)
    return fmt::format("the recorded answer to observation {} has {} values in and {} out, {} has {} and {}",
                       input.header.observation_id, input.input.size() + values_of_images_, input.output.size(),
                       result_.file, policy_->input_size(), policy_->output_size());
  return {};
}

// The input as the network was shown it. False: an image of it is not to be had.
bool Replayer::put_images(monitor::PolicyInput& input) {
  const auto& places = observation_.image_places();
  std::vector<float> whole;
  auto rest = input.input.begin();
  for (const policy_host::ImagePlace& place : places) {
    const auto behind = rest + static_cast<std::ptrdiff_t>(place.at - whole.size());
    whole.insert(whole.end(), rest, behind);
    whole.resize(whole.size() + place.width);
    rest = behind;
  }
  whole.insert(whole.end(), rest, input.input.end());
  for (std::size_t i = 0; i < places.size(); ++i) {
    const PolicyInputSample& sample = input.samples[i];
    const bool is_its = sample.sensor == places[i].sensor && sample.value_count == 0;
    auto bytes = is_its ? images_.bytes_of(sample) : std::unexpected("the input names another sensor");
    if (bytes && bytes->size() != places[i].width) bytes = std::unexpected("the image has another shape");
    if (!bytes) {
      if (++result_.without_image == 1)
        result_.first_without_image = fmt::format("observation {}: {}: {}", input.header.observation_id,
                                                  robot_.sensors[places[i].sensor].name, bytes.error());
      return false;
    }
    observation_.put_image(places[i], *bytes, whole);
  }
  input.input = std::move(whole);
  return true;
}

// The network's state before this inference is as it was then.
bool Replayer::follow(const monitor::PolicyInput& input) {
  const PolicyInputHeader& header = input.header;
  const bool goes_on = last_inference_ != 0 && header.inference == last_inference_ + 1;
  if (last_inference_ != 0 && header.inference > last_inference_ + 1)
    result_.missing += header.inference - last_inference_ - 1;
  last_inference_ = header.inference;
  if (header.after_reset != 0) policy_->reset();
  state_known_ = !remembers_ || header.after_reset != 0 || (goes_on && state_known_);
  return state_known_;
}

std::string Replayer::answer(monitor::RecordedPolicyInput recorded) {
  ++result_.answers;
  bool is_sound = monitor::crc_of(recorded.input) == recorded.crc;
  if (!is_sound) {
    const auto place = mend(recorded);
    if (++result_.altered == 1)
      result_.first_altered = fmt::format("observation {}: {}", recorded.input.header.observation_id,
                                          place.value_or("what was altered is not known"));
    is_sound = place.has_value();
  }
  if (is_sound) {
    if (std::string reason = unfit(recorded.input); !reason.empty()) return reason;
  }
  bool is_judged = is_sound && follow(recorded.input);
  if (is_judged && !put_images(recorded.input)) state_known_ = is_judged = false;
  if (is_judged)
    judge(recorded.input);
  else
    ++result_.not_judged;
  if (is_sound && !result_.is_mixed) expect_command(recorded.input);
  return {};
}

void Replayer::judge(const monitor::PolicyInput& input) {
  result_.is_of_the_run = input.header.policy_hash == result_.hash && input.header.built_in != 0;
  policy_->infer(input.input, output_);
  if (std::memcmp(output_.data(), input.output.data(), 4 * output_.size()) == 0) ++result_.identical;
  measure(input);
}

void Replayer::fill(CommandChunk& chunk, const monitor::PolicyInput& input, std::span<const float> outputs) const {
  Observation answered;
  answered.id = input.header.observation_id;
  std::ranges::copy(input.q(), answered.q.at.begin());
  builder_.fill(chunk, answered, outputs);
  chunk.header.policy_hash = input.header.policy_hash;
}

void Replayer::measure(const monitor::PolicyInput& input) {
  fill(*recorded_, input, input.output);
  fill(*recomputed_, input, output_);
  const CommandField field = config::target_of(robot_.policy->action.kind).field;
  std::optional<PolicyDifference> beyond;
  for (std::size_t step = 0; step < recorded_->header.step_count; ++step) {
    for (std::size_t joint = 0; joint < joints_.size(); ++joint) {
      const std::size_t at = value_index(recorded_->header, field, step, joint);
      const double was = recorded_->values[at];
      const double is = recomputed_->values[at];
      const bool neither = std::isnan(was) && std::isnan(is);
      const double distance = was == is || neither ? 0 : std::abs(is - was);
      Sum& sum = joints_[joint];
      ++sum.values;
      if (std::isfinite(distance)) {
        sum.largest = std::max(sum.largest, distance);
        sum.squares += distance * distance;
      }
      if (!beyond && !(distance <= tolerance_))
        beyond = {input.header.observation_id, input.header.sequence, step, robot_.joints[joint].name, was, is};
    }
  }
  if (!beyond) return;
  if (++result_.beyond == 1) result_.first_beyond = std::move(beyond);
}

void Replayer::settle(std::uint32_t answered, std::uint32_t read) {
  ++result_.commands;
  if (answered == read) ++result_.as_answered;
}

void Replayer::expect_command(const monitor::PolicyInput& input) {
  fill(*recorded_, input, input.output);
  const auto values = std::as_bytes(std::span(recorded_->values).first(recorded_->value_count()));
  const std::uint32_t content = content_of(recorded_->header, values);
  const Key key{input.header.observation_id, input.header.sequence};
  if (const auto found = read_.find(key); found != read_.end()) {
    settle(content, found->second);
    read_.erase(found);
  } else {
    answered_[key] = content;
  }
}

void Replayer::command(const monitor::RecordedCommand& recorded) {
  const auto header = monitor::header_of(recorded);
  if (!header || recorded.cut_from != 0 || result_.is_mixed) return;
  const std::uint32_t content = content_of(*header, std::span(recorded.payload).subspan(sizeof(CommandHeader)));
  const Key key{header->observation_id, header->sequence};
  if (const auto found = answered_.find(key); found != answered_.end()) {
    settle(found->second, content);
    answered_.erase(found);
  } else {
    read_[key] = content;
  }
}

PolicyReplay Replayer::finish() {
  const std::uint64_t untold = result_.before + result_.lost + stood_by_;
  result_.unanswered = read_.size() - std::min<std::uint64_t>(read_.size(), untold);
  result_.missing -= std::min(result_.missing, stood_by_);
  for (std::size_t joint = 0; joint < joints_.size(); ++joint) {
    const Sum& sum = joints_[joint];
    const double rms = sum.values == 0 ? 0 : std::sqrt(sum.squares / static_cast<double>(sum.values));
    const config::Joint& said = robot_.joints[joint];
    const auto& quantity = config::target_of(robot_.policy->action.kind).quantity;
    result_.joints.push_back({said.name, std::string(quantity.unit(said.kind)), sum.largest, rms});
  }
  return std::move(result_);
}

// config.yaml names files as the robot's file did, relative to a place that only the manifest's policy file tells.
config::RobotConfig with_files_of_the_run(const monitor::RecordedRun& run) {
  config::RobotConfig robot = run.robot;
  const std::string& was = run.manifest.policy_file;
  const std::string here = (std::filesystem::absolute(run.folder.path()) / "").lexically_normal().string();
  const auto below = [&](const std::string& file) { return std::string_view(file).substr(here.size()); };
  std::string& file = robot.policy->file;
  if (file.starts_with(here) && was.ends_with(below(file))) {
    const std::string there = was.substr(0, was.size() - below(file).size());
    for (config::Fallback& fallback : robot.fallbacks)
      if (fallback.file.starts_with(here)) fallback.file = there + std::string(below(fallback.file));
  }
  file = was;
  return robot;
}

// Whose mailbox a command came from: who is in charge changes on a live robot, the policy's file does not.
Player seat_of(const monitor::RecordedCommand& command, const monitor::RecordedRun& run) {
  const auto header = monitor::header_of(command);
  if (command.sender == Player::fallback || !header || run.manifest.policy_sha256.empty()) return command.sender;
  return fmt::format("{:016x}", header->policy_hash) == run.manifest.policy_sha256.substr(0, 16) ? Player::policy
                                                                                                 : Player::candidate;
}

// As losses name it (monitor/record/policy_input_stream.hpp).
std::string input_ring_of(Player sender) {
  return fmt::format("{}_input", name(sender));
}

// What a run says before its answers are gone through.
struct Evidence {
  std::set<Player> of, of_clients;  // whose inputs there are; of these, those that libtakt-client told
  RunImages images;
};

Evidence evidence_in(const monitor::RecordedRun& run) {
  Evidence evidence{{}, {}, RunImages(run.folder)};
  (void)monitor::scan_run(run, {.tick = {},
                                .command = {},
                                .keyframe = {},
                                .loss = {},
                                .policy_input =
                                    [&](const monitor::RecordedPolicyInput& input) {
                                      evidence.of.insert(input.sender);
                                      if (input.input.header.by_client != 0) evidence.of_clients.insert(input.sender);
                                    },
                                .image = [&](const monitor::ShownImage& image) { evidence.images.add(image); }});
  return evidence;
}

// Nothing: this policy said nothing of its inputs.
std::expected<std::unique_ptr<Replayer>, PolicyReplayRefusal> replayer_of(const monitor::RecordedRun& run,
                                                                          Player sender,
                                                                          const PolicyReplayOptions& options,
                                                                          Evidence& evidence) {
  if (!evidence.of.contains(sender)) return nullptr;
  if (evidence.of_clients.contains(sender))
    return refused(Why::policy,
                   fmt::format("the run's {} is a program of its own (takt/client.h): what it was shown "
                               "is recorded, read it by takt.open(\"{}\").policy_inputs; only a network "
                               "that takt-policy-host ran can be run again",
                               sender == Player::fallback ? "fallback policy" : "policy", run.folder.path()));
  config::RobotConfig robot = with_files_of_the_run(run);
  if (sender == Player::fallback) robot = config::seen_by_fallback(robot, *config::fallback_policy_of(robot));
  return Replayer::make(std::move(robot), sender, options, evidence.images);
}

}  // namespace

bool PolicyReplayReport::agrees() const {
  return file.damaged_chunks == 0 && std::ranges::all_of(policies, [](const PolicyReplay& policy) {
           const std::uint64_t judged = policy.answers - policy.not_judged;
           const bool same = policy.is_of_the_run ? policy.identical == judged : policy.beyond == 0;
           return same && judged != 0 && policy.altered == 0 && policy.as_answered == policy.commands;
         });
}

bool PolicyReplayReport::is_whole() const {
  return missing_ticks == 0 && unrecorded_ticks == 0 && fallback_unanswered == 0 &&
         std::ranges::all_of(policies, [](const PolicyReplay& policy) {
           return policy.not_judged == 0 && policy.missing == 0 && policy.lost == 0 && policy.unanswered == 0;
         });
}

std::expected<PolicyReplayReport, PolicyReplayRefusal> replay_policy(const monitor::RecordedRun& run,
                                                                     const PolicyReplayOptions& options) {
  if (!run.robot.policy) return refused(Why::no_evidence, run.folder.config() + ": the robot has no policy");
  Evidence evidence = evidence_in(run);
  std::vector<std::unique_ptr<Replayer>> replayers;
  for (const Player sender : {Player::policy, Player::fallback}) {
    const bool is_asked_for = sender == Player::policy || options.with.empty();
    if (!is_asked_for || (sender == Player::fallback && config::fallback_policy_of(run.robot) == nullptr)) continue;
    auto replayer = replayer_of(run, sender, options, evidence);
    if (!replayer) return std::unexpected(replayer.error());
    if (*replayer) replayers.push_back(std::move(*replayer));
  }
  if (replayers.empty())
    return refused(
        Why::no_evidence,
        run.folder.ticks() + " has no policy inputs: `record.policy_inputs` was false, or nothing was answered");

  std::string reason;
  const auto of = [&](Player sender) -> Replayer* {
    const auto found = std::ranges::find_if(replayers, [&](const auto& each) { return each->sender() == sender; });
    return found == replayers.end() || !reason.empty() ? nullptr : found->get();
  };
  PolicyReplayReport report;
  std::uint64_t ticks = 0;
  const auto scan = monitor::scan_run(run, {.tick = [&](const monitor::RecordedTick&) { ++ticks; },
                                            .command =
                                                [&](const monitor::RecordedCommand& command) {
                                                  const Player seat = seat_of(command, run);
                                                  if (Replayer* const replayer = of(seat))
                                                    return replayer->command(command);
                                                  if (seat == Player::fallback && options.with.empty())
                                                    ++report.fallback_unanswered;
                                                },
                                            .keyframe = {},
                                            .loss =
                                                [&](const monitor::Loss& loss) {
                                                  for (const auto& replayer : replayers)
                                                    if (loss.ring == input_ring_of(replayer->sender()))
                                                      replayer->lost(loss);
                                                },
                                            .policy_input =
                                                [&](const monitor::RecordedPolicyInput& input) {
                                                  if (Replayer* const replayer = of(input.sender))
                                                    reason = replayer->answer(input);
                                                }});
  if (!scan) return refused(Why::no_evidence, scan.error());
  if (!reason.empty()) return refused(Why::policy, reason);
  report.tolerance = options.tolerance;
  report.missing_ticks = monitor::missing_ticks(run.manifest, ticks);
  report.unrecorded_ticks = run.manifest.unrecorded_ticks;
  report.file = scan->file;
  for (const auto& replayer : replayers) report.policies.push_back(replayer->finish());
  return report;
}

}  // namespace takt::evidence
