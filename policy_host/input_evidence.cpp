// SPDX-License-Identifier: Apache-2.0
#include "policy_host/input_evidence.hpp"

#include "config/observation_shape.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::policy_host {

InputEvidence::InputEvidence(const config::RobotConfig& robot, std::uint64_t policy_hash, bool built_in,
                             PathOwner owner)
    : joints_(robot.joints.size()),
      owner_(owner),
      image_places_(ObservationBuilder(robot).image_places()),
      payload_(config::largest_policy_input(robot)) {
  for (const std::size_t sensor : sensors_in_use(robot))
    if (!robot.sensors[sensor].image) sensors_.push_back(sensor);
  header_.policy_hash = policy_hash;
  header_.joint_count = static_cast<std::uint32_t>(joints_);
  header_.sample_count = static_cast<std::uint32_t>(image_places_.size() + sensors_.size());
  header_.built_in = built_in ? 1 : 0;
  header_.quantities = static_cast<std::uint8_t>(ShownQuantity::q);
}

void InputEvidence::put_samples(PolicyInputPacker& packer, std::span<const SensorSample> samples,
                                std::span<const SeenImage> images) const {
  for (const SeenImage& seen : images) {
    const PolicyInputSample sample{seen.sequence, seen.sensed_at, seen.published_at,
                                   static_cast<std::uint32_t>(seen.sensor), 0};
    packer.put(std::span(&sample, 1));
  }
  for (const std::size_t sensor : sensors_) {
    const SensorSample& used = samples[sensor];
    const PolicyInputSample sample{used.sequence, used.sensed_at, used.published_at, static_cast<std::uint32_t>(sensor),
                                   used.value_count};
    packer.put(std::span(&sample, 1));
  }
}

std::span<const std::byte> InputEvidence::pack(const Observation& answered, std::span<const SensorSample> samples,
                                               std::uint64_t sequence, const Inference& inference) {
  const bool is_ours = owner_ != PathOwner::nobody && (answered.of_candidate != 0) == (owner_ == PathOwner::candidate);
  std::size_t of_images = 0;
  for (const ImagePlace& place : image_places_) of_images += place.width;
  header_.observation_id = answered.id;
  header_.sequence = sequence;
  header_.inference = inference.number;
  header_.following = is_ours ? answered.command_sequence : 0;
  header_.committed_from = is_ours ? answered.committed_from : 0;
  header_.committed_count = is_ours ? answered.committed_count : 0;
  header_.input_count = static_cast<std::uint32_t>(inference.input.size() - of_images);
  header_.output_count = static_cast<std::uint32_t>(inference.output.size());
  header_.after_reset = inference.after_reset ? 1 : 0;

  PolicyInputPacker packer(payload_);
  packer.put(std::span<const PolicyInputHeader>(&header_, 1));
  put_samples(packer, samples, inference.images);
  packer.put(std::span<const float>(answered.q.at).first(joints_));
  for (const std::size_t sensor : sensors_)
    packer.put(std::span<const float>(samples[sensor].values).first(samples[sensor].value_count));
  std::size_t from = 0;
  for (const ImagePlace& place : image_places_) {
    packer.put(inference.input.subspan(from, place.at - from));
    from = place.at + place.width;
  }
  packer.put(inference.input.subspan(from));
  packer.put(inference.output);
  return packer.packed();
}

}  // namespace takt::policy_host
