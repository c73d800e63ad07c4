// SPDX-License-Identifier: Apache-2.0
// The least that a tick must do, as a floor for what ours does: read the newest command and check each of its values,
// follow its first step by a PD law, clamp torques, keep position and speed inside barriers in closed form, project on
// eight half-spaces three times, and push a record of 512 bytes. No modes, ages, references, model or evidence.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <memory>
#include <optional>
#include <span>

#include "executive/contract/command_chunk.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::bench {

inline constexpr ipc::RingShape kFloorRing{.slot_count = 1024, .payload_capacity = 512, .layout = 1};

class TickFloor {
 public:
  // `commands`: the mailbox; `records`: ring_bytes(kFloorRing) zeroed bytes. Both outlive this.
  TickFloor(std::uint32_t joints, std::span<std::byte> commands, std::span<std::byte> records)
      : commands_(commands), records_(records, kFloorRing), half_spaces_(8, joints), reach_(8) {
    for (Eigen::VectorXf* vector : {&q_, &dq_, &target_, &torque_, &low_, &high_}) vector->setZero(joints);
    half_spaces_.setRandom();
    reach_ = half_spaces_.rowwise().squaredNorm();
  }

  void tick() {
    read_command();
    torque_ = (kStiffness * (target_ - q_) - kDamping * dq_).cwiseMax(-kTorque).cwiseMin(kTorque);
    high_ = ((kSharpness * (kReach - q_.array())).min(kSpeed) - dq_.array()) * kSharpness;
    low_ = ((-kSharpness * (kReach + q_.array())).max(-kSpeed) - dq_.array()) * kSharpness;
    torque_ = torque_.cwiseMin(high_.cwiseMin(kTorque)).cwiseMax(low_.cwiseMax(-kTorque));
    for (int sweep = 0; sweep < 3; ++sweep) {
      for (Eigen::Index plane = 0; plane < half_spaces_.rows(); ++plane) {
        const float beyond = half_spaces_.row(plane).dot(torque_) - kBound;
        if (beyond > 0) torque_ -= half_spaces_.row(plane).transpose() * (beyond / reach_[plane]);
      }
    }
    dq_ = 0.99F * (dq_ + 1e-3F * torque_);
    q_ += 1e-3F * dq_;
    std::memcpy(record_.data(), torque_.data(),
                std::min(sizeof(float) * static_cast<std::size_t>(torque_.size()), record_.size()));
    records_.publish(record_);
  }

 private:
  static constexpr float kStiffness = 60, kDamping = 2, kTorque = 40, kReach = 2, kSpeed = 10, kSharpness = 20,
                         kBound = 30;

  void read_command() {
    if (!reader_) {
      auto attached = ipc::SlotReader::attach(commands_, ipc::command_mailbox());
      if (!attached) return;
      reader_ = *attached;
    }
    const auto bytes = std::as_writable_bytes(std::span(chunk_.get(), 1));
    if (reader_->read_latest(bytes).status != ipc::ReadStatus::fresh) return;
    bool is_sound = true;
    for (std::size_t i = 0; i < chunk_->value_count(); ++i)
      is_sound = is_sound && chunk_->values[i] > -kReach && chunk_->values[i] < kReach;
    const auto joints = static_cast<std::size_t>(target_.size());
    if (!is_sound || chunk_->value_count() < joints) return;
    std::copy_n(chunk_->values, joints, target_.data());
  }

  std::span<std::byte> commands_;
  ipc::SlotWriter records_;
  std::optional<ipc::SlotReader> reader_;
  std::unique_ptr<CommandChunk> chunk_ = std::make_unique<CommandChunk>();
  Eigen::VectorXf q_, dq_, target_, torque_, low_, high_;
  Eigen::MatrixXf half_spaces_;
  Eigen::VectorXf reach_;
  std::array<std::byte, 512> record_{};
};

}  // namespace takt::bench
