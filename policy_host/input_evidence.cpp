#include "policy_host/input_evidence.hpp"

#include "config/observation_shape.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::policy_host {

InputEvidence::InputEvidence(const config::RobotConfig& robot, std::uint64_t policy_hash, bool built_in)
    : joints_(robot.joints.size()), sensors_(sensors_in_use(robot)), payload_(config::largest_policy_input(robot)) {
  header_.policy_hash = policy_hash;
  header_.joint_count = static_cast<std::uint32_t>(joints_);
  header_.sensor_count = static_cast<std::uint32_t>(sensors_.size());
  header_.built_in = built_in ? 1 : 0;
}

std::span<const std::byte> InputEvidence::pack(const Observation& answered, std::span<const SensorSample> samples,
                                               std::uint64_t sequence, const Inference& inference) {
  header_.observation_id = answered.id;
  header_.sequence = sequence;
  header_.inference = inference.number;
  header_.input_count = static_cast<std::uint32_t>(inference.input.size());
  header_.output_count = static_cast<std::uint32_t>(inference.output.size());
  header_.after_reset = inference.after_reset ? 1 : 0;

  PolicyInputPacker packer(payload_);
  packer.put(std::span<const PolicyInputHeader>(&header_, 1));
  for (const std::size_t sensor : sensors_) {
    const SensorSample& used = samples[sensor];
    const PolicyInputSample sample{used.sequence, used.sensed_at, used.published_at, static_cast<std::uint32_t>(sensor),
                                   used.value_count};
    packer.put(std::span(&sample, 1));
  }
  packer.put(std::span<const float>(answered.q.at).first(joints_));
  for (const std::size_t sensor : sensors_)
    packer.put(std::span<const float>(samples[sensor].values).first(samples[sensor].value_count));
  packer.put(inference.input);
  packer.put(inference.output);
  return packer.packed();
}

}  // namespace takt::policy_host
