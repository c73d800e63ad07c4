// SPDX-License-Identifier: Apache-2.0
#include "policy_host/remote/wire_messages.hpp"

#include <algorithm>

#include "executive/contract/mode.hpp"

namespace takt::policy_host::remote {
namespace {

// What another machine says, for a log.
std::string shown(const char* said) {
  std::string text(said);
  for (char& c : text)
    if (c < ' ' || c > '~') c = '?';
  return text;
}

}  // namespace

Answer answer_of(const takt_remote_Command& message, const PeerId& sender) {
  return {.sender = sender,
          .server = message.server,
          .epoch = message.epoch,
          .config_hash = message.config_hash,
          .policy_hash = message.policy_hash,
          .observation_id = message.observation_id,
          .sequence = message.number,
          .queued = {message.queued_ns},
          .inferred = {message.inferred_ns},
          .older = {message.older_ns},
          .dropped = message.dropped,
          .step_period = {message.step_period_ns},
          .step_count = message.step_count,
          .joint_count = message.joint_count,
          .fields = message.fields,
          .value_count = message.values._length};
}

std::string server_name_of(const takt_remote_Command& message) {
  return shown(message.name);
}

std::string source_of(const takt_remote_Command& message) {
  return shown(message.source);
}

ServerState state_of(const takt_remote_ServerStatus& message, const PeerId& sender, MonoTime heard_at) {
  return {.sender = sender,
          .name = shown(message.name),
          .address = shown(message.address),
          .problem = shown(message.problem),
          .has_policy = message.has_policy,
          .lacks_samples = message.lacks_samples,
          .has_other_files = message.has_other_files,
          .epoch = message.epoch,
          .shown_age = {message.shown_age_ns},
          .heard_at = heard_at};
}

bool is_sound(const takt_remote_Observation& message, std::size_t joints) {
  const bool fits = message.q._length == joints && message.dq._length == joints && message.tau._length == joints &&
                    message.q_setpoint._length == joints && message.dq_of_drive._length == joints &&
                    (message.imu._length == 0 || message.imu._length == kImuValues);
  return fits && message.id != 0 && message.age_ns >= 0 && message.oldest_age_ns >= message.age_ns &&
         message.imu_age_ns >= 0 && message.period_ns > 0 && message.mode < kModeCount && message.epoch != 0;
}

Observation observation_of(const takt_remote_Observation& message, MonoTime arrived_at) {
  const auto before = [arrived_at](std::int64_t age_ns) {
    return MonoTime{std::max<std::int64_t>(arrived_at.ns - age_ns, 1)};
  };
  Observation observation;
  observation.tick = message.tick;
  observation.published_at = before(message.age_ns);
  observation.oldest_sensed_at = before(message.oldest_age_ns);
  observation.period = {message.period_ns};
  observation.joint_count = message.q._length;
  observation.mode = message.mode;
  std::copy_n(message.q._buffer, message.q._length, observation.q.at.begin());
  std::copy_n(message.dq._buffer, message.q._length, observation.dq.at.begin());
  std::copy_n(message.tau._buffer, message.q._length, observation.tau.at.begin());
  std::copy_n(message.q_setpoint._buffer, message.q._length, observation.q_setpoint.at.begin());
  std::copy_n(message.dq_of_drive._buffer, message.q._length, observation.dq_of_drive.at.begin());
  if (message.imu_sequence != 0 && message.imu._length == kImuValues) {
    observation.imu.sequence = message.imu_sequence;
    observation.imu.sensed_at = before(message.imu_age_ns);
    std::copy_n(message.imu._buffer, 4, observation.imu.rotation);
    std::copy_n(message.imu._buffer + 4, 3, observation.imu.angular_velocity);
    std::copy_n(message.imu._buffer + 7, 3, observation.imu.acceleration);
  }
  return observation;
}

}  // namespace takt::policy_host::remote
