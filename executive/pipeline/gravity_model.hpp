// SPDX-License-Identifier: Apache-2.0
// Torques that hold a tree of links still against gravity, in O(joints), without allocation.
//
// Down the tree the gravity vector is turned into each link's frame; up the tree mass and first moment of mass are
// gathered about each joint; the torque is the part of moment x gravity along the axis. A link's rotation is a sum of
// three constant matrices, fixed + cos(q) even + sin(q) odd, made once from the configuration: so all rotations of a
// tick can be computed side by side, and only two vector turns per joint depend on one another. A link that slides is
// turned by none of them and moves its joint's origin; its force is the subtree's weight along the axis.
// Units: q rad, result Nm on the joint side; of a slide m and N. Precondition: parents before children
// (LinkModel::parent).
// Source: statics of open chains, e.g. Featherstone, Rigid Body Dynamics Algorithms (2008), section 5.3 with zero
// motion; Rodrigues' formula for the rotation.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

class GravityModel {
 public:
  GravityModel() = default;
  explicit GravityModel(const TickConfig& config);

  // torques[j] = torque joint j must apply. q and torques hold the configuration's joint_count entries.
  void torques(std::span<const float> q, std::span<float> torques) const;
  // No pose asks more of the joint, Nm or N.
  [[nodiscard]] float most(std::size_t joint) const { return most_[joint]; }
  // swing[j]: no more than this does torques[j] change while every joint k moves by moves[k] >= 0, rad or m. The second
  // derivatives of the potential energy are bounded by the weight beyond the outer of two joints times its reach,
  // whatever the pose; joints of different branches do not meet.
  void swing(std::span<const float> moves, std::span<float> swing) const;

 private:
  using Matrix = std::array<float, 9>;  // row-major, link frame to parent frame
  struct Link {
    Matrix fixed{}, even{}, odd{};
    std::array<float, 3> axis{}, origin{}, moment{};  // moment: mass times centre of mass
    std::array<float, 3> way{};                       // of the origin per metre of a slide, parent frame
    bool slides = false;
    float mass = 0;
    std::int32_t parent = -1;
  };
  std::array<Link, kMaxJoints> links_{};
  std::array<float, 3> gravity_{};
  std::array<float, kMaxJoints> most_{};
  std::uint32_t count_ = 0;
};

}  // namespace takt::pipeline
