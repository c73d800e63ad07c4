// SPDX-License-Identifier: Apache-2.0
#include "policy_host/remote/answer_gate.hpp"

#include <algorithm>

namespace takt::policy_host::remote {

void AnswerGate::begin(std::uint64_t epoch) {
  epoch_ = epoch;
  newest_played_ = sequence_ = 0;
  shown_ = {};
  played_ = {};
}

bool AnswerGate::has_shape(const Answer& answer) const {
  const auto has_q = (answer.fields & static_cast<unsigned>(CommandField::q)) != 0;
  if (!has_q || (answer.fields & ~unsigned{kAllCommandFields}) != 0) return false;
  if (answer.step_count != facts_.step_count || answer.joint_count != facts_.joint_count) return false;
  const std::size_t values = std::size_t{answer.step_count} * answer.joint_count * field_count(answer.fields);
  return answer.step_period == facts_.step_period && answer.value_count == values && values <= kMaxChunkValues;
}

bool AnswerGate::is_taken(const Answer& answer, MonoTime now) const {
  return std::ranges::any_of(heard_, [&](const Heard& each) {
    return each.server == answer.server && each.sender != answer.sender && each.usable_at.is_set() &&
           now - each.usable_at <= facts_.max_age;
  });
}

AnswerGate::Heard& AnswerGate::heard(const PeerId& sender) {
  auto* found = std::ranges::find(heard_, sender, &Heard::sender);
  if (found != heard_.end()) return *found;
  found = std::ranges::min_element(heard_, {}, &Heard::usable_at);
  *found = {.sender = sender, .server = 0, .sequence = 0, .usable_at = {}};
  return *found;
}

AnswerVerdict AnswerGate::judge(const Answer& answer, bool all_finite, MonoTime now) {
  if (answer.config_hash != facts_.config_hash || answer.policy_hash != facts_.policy_hash || answer.server == 0)
    return AnswerVerdict::other_robot;
  if (epoch_ == 0 || answer.epoch != epoch_) return AnswerVerdict::other_epoch;
  const Shown& shown = shown_[answer.observation_id % shown_.size()];
  if (answer.observation_id == 0 || shown.id != answer.observation_id) return AnswerVerdict::unknown;
  if (!has_shape(answer)) return AnswerVerdict::wrong_shape;
  if (!all_finite) return AnswerVerdict::not_finite;
  if (is_taken(answer, now)) return AnswerVerdict::of_another;
  Heard& sender = heard(answer.sender);
  if (answer.sequence <= sender.sequence) return AnswerVerdict::repeated;
  sender.sequence = answer.sequence;
  if (answer.observation_id < newest_played_ || now - shown.published_at > facts_.max_age)
    return AnswerVerdict::overtaken;
  sender.server = answer.server;
  sender.usable_at = now;
  return AnswerVerdict::usable;
}

CommandHeader AnswerGate::play(const Answer& answer, MonoTime now) {
  const Shown& shown = shown_[answer.observation_id % shown_.size()];
  newest_played_ = answer.observation_id;
  CommandHeader header;
  header.observation_id = answer.observation_id;
  header.sequence = ++sequence_;
  header.policy_hash = facts_.policy_hash;
  header.outside_sensed_at = shown.outside_sensed_at;
  if (answer.older > Duration{}) {
    MonoTime oldest = shown.oldest_sensed_at;
    if (shown.outside_sensed_at.is_set()) oldest = std::min(oldest, shown.outside_sensed_at);
    header.outside_sensed_at = oldest - std::min(answer.older, oldest - MonoTime{1});
  }
  header.dequeued_at = shown.dequeued_at;
  const auto later = [now](MonoTime from, Duration claimed) {
    return from + std::clamp(claimed, Duration{}, std::max(now - from, Duration{}));
  };
  header.infer_started_at = later(header.dequeued_at, answer.queued);
  header.infer_ended_at = later(header.infer_started_at, answer.inferred);
  header.published_at = now;
  header.step_period = answer.step_period;
  header.dropped_observations = answer.dropped;
  header.step_count = static_cast<std::uint16_t>(answer.step_count);
  header.joint_count = static_cast<std::uint16_t>(answer.joint_count);
  header.fields = answer.fields;
  played_[header.sequence % played_.size()] = {header.sequence, {answer.server, answer.sequence}};
  return header;
}

AnswerGate::Played AnswerGate::played(std::uint64_t sequence) const {
  const PlayedAs& found = played_[sequence % played_.size()];
  return sequence != 0 && found.sequence == sequence ? found.chunk : Played{};
}

AnswerGate::Followed AnswerGate::followed(const Observation& observation) const {
  if (observation.of_candidate != 0) return {};
  return {played(observation.command_sequence), observation.committed_from, observation.committed_count};
}

}  // namespace takt::policy_host::remote
