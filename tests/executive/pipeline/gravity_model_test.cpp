// SPDX-License-Identifier: Apache-2.0
// Goal: gravity torques are right for any tree of hinges and slides. Method: random trees; the torque must equal the
// slope of the potential energy, computed in double precision by forward kinematics with matrices, which shares nothing
// with the recursion; and KDL's inverse dynamics of the same tree at rest.
#include "executive/pipeline/gravity_model.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <kdl/tree.hpp>
#include <kdl/treeidsolver_recursive_newton_euler.hpp>
#include <random>
#include <vector>

#include "executive/pipeline/sin_cos.hpp"

namespace takt::pipeline {
namespace {

struct RandomTree {
  TickConfig config;
  std::array<float, kMaxJoints> q{};
};

RandomTree random_tree(std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(-1.0F, 1.0F);
  RandomTree tree;
  tree.config.joint_count = 1 + random() % kMaxJoints;
  tree.config.gravity = {unit(random), 3.0F * unit(random), -9.0F + unit(random)};
  for (std::uint32_t i = 0; i < tree.config.joint_count; ++i) {
    LinkModel& link = tree.config.links[i];
    link.parent = static_cast<std::int32_t>(random() % (i + 1)) - 1;
    const Eigen::Quaternionf turn = Eigen::Quaternionf(unit(random), unit(random), unit(random), 1.1F).normalized();
    const Eigen::Matrix<float, 3, 3, Eigen::RowMajor> rotation = turn.toRotationMatrix();
    std::copy_n(rotation.data(), 9, link.origin_rotation.begin());
    const Eigen::Vector3f axis = Eigen::Vector3f(unit(random), unit(random), 1.1F).normalized();
    link.axis = {axis.x(), axis.y(), axis.z()};
    for (float& v : link.origin_xyz) v = 0.3F * unit(random);
    for (float& v : link.com) v = 0.2F * unit(random);
    link.mass = 1.0F + unit(random);
    tree.q[i] = 3.0F * unit(random);
    link.slides = random() % 4 == 0;
    if (link.slides) tree.q[i] *= 0.1F;
  }
  return tree;
}

Eigen::Vector3d vec(const std::array<float, 3>& a) {
  return {static_cast<double>(a[0]), static_cast<double>(a[1]), static_cast<double>(a[2])};
}

double potential_energy(const TickConfig& config, const std::vector<double>& q) {
  std::vector<Eigen::Isometry3d> frames(config.joint_count);
  double energy = 0;
  for (std::size_t i = 0; i < config.joint_count; ++i) {
    const LinkModel& link = config.links[i];
    Eigen::Isometry3d origin = Eigen::Isometry3d::Identity();
    origin.linear() =
        Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(link.origin_rotation.data()).cast<double>();
    origin.translation() = vec(link.origin_xyz);
    const Eigen::Isometry3d above =
        link.parent < 0 ? Eigen::Isometry3d::Identity() : frames[static_cast<std::size_t>(link.parent)];
    const Eigen::Vector3d axis = vec(link.axis).normalized();
    frames[i] = above * origin;
    if (link.slides)
      frames[i] = frames[i] * Eigen::Translation3d(q[i] * axis);
    else
      frames[i] = frames[i] * Eigen::AngleAxisd(q[i], axis);
    energy -= static_cast<double>(link.mass) * vec(config.gravity).dot(frames[i] * vec(link.com));
  }
  return energy;
}

TEST(GravityModel, TorqueIsTheSlopeOfPotentialEnergy) {
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    const RandomTree tree = random_tree(seed);
    std::array<float, kMaxJoints> torques{};
    GravityModel(tree.config).torques(tree.q, torques);
    std::vector<double> q(tree.q.begin(), tree.q.begin() + tree.config.joint_count);
    for (std::size_t j = 0; j < q.size(); ++j) {
      const double centre = q[j];
      q[j] = centre + 1e-5;
      const double above = potential_energy(tree.config, q);
      q[j] = centre - 1e-5;
      const double below = potential_energy(tree.config, q);
      q[j] = centre;
      ASSERT_NEAR(static_cast<double>(torques[j]), (above - below) / 2e-5, 2e-3) << "seed " << seed << " joint " << j;
    }
  }
}

KDL::Vector kdl(const std::array<float, 3>& a) {
  return {static_cast<double>(a[0]), static_cast<double>(a[1]), static_cast<double>(a[2])};
}

// A KDL segment is joint, then tip frame; ours is origin, then joint: the origin becomes a fixed segment of its own.
KDL::Tree kdl_tree(const TickConfig& config) {
  KDL::Tree tree("base");
  for (std::size_t i = 0; i < config.joint_count; ++i) {
    const LinkModel& link = config.links[i];
    const auto& r = link.origin_rotation;
    const auto d = [&r](std::size_t k) { return static_cast<double>(r[k]); };
    const KDL::Frame origin(KDL::Rotation(d(0), d(1), d(2), d(3), d(4), d(5), d(6), d(7), d(8)), kdl(link.origin_xyz));
    const std::string name = "link" + std::to_string(i);
    const std::string hook = link.parent < 0 ? "base" : "link" + std::to_string(link.parent);
    tree.addSegment(KDL::Segment(name + "_origin", KDL::Joint(KDL::Joint::None), origin), hook);
    const KDL::Joint joint("joint" + std::to_string(1000 + i), KDL::Vector::Zero(), kdl(link.axis),
                           link.slides ? KDL::Joint::TransAxis : KDL::Joint::RotAxis);
    tree.addSegment(KDL::Segment(name, joint, KDL::Frame::Identity(),
                                 KDL::RigidBodyInertia(static_cast<double>(link.mass), kdl(link.com))),
                    name + "_origin");
  }
  return tree;
}

TEST(GravityModel, AgreesWithKdlOnTreesAtRest) {
  for (std::uint32_t seed = 100; seed < 130; ++seed) {
    const RandomTree random = random_tree(seed);
    const TickConfig& config = random.config;
    std::array<float, kMaxJoints> torques{};
    GravityModel(config).torques(random.q, torques);
    const KDL::Tree tree = kdl_tree(config);
    KDL::JntArray q(config.joint_count), zero(config.joint_count), expected(config.joint_count);
    const auto index_in_kdl = [&](std::size_t i) {
      return GetTreeElementQNr(tree.getSegment("link" + std::to_string(i))->second);
    };
    for (std::size_t i = 0; i < config.joint_count; ++i) q(index_in_kdl(i)) = static_cast<double>(random.q[i]);
    KDL::TreeIdSolver_RNE solver(tree, kdl(config.gravity));
    ASSERT_GE(solver.CartToJnt(q, zero, zero, {}, expected), 0);
    for (std::size_t i = 0; i < config.joint_count; ++i)
      ASSERT_NEAR(static_cast<double>(torques[i]), expected(index_in_kdl(i)), 2e-3)
          << "seed " << seed << " joint " << i;
  }
}

TEST(SinCos, MatchesTheLibrary) {
  std::mt19937 random(7);
  for (const float range : {1.0F, 4.0F, 100.0F, 1.0e5F}) {
    std::uniform_real_distribution<float> angles(-range, range);
    for (int i = 0; i < 100'000; ++i) {
      const float angle = angles(random);
      const SinCos ours = sin_cos(angle);
      ASSERT_NEAR(ours.sin, static_cast<float>(std::sin(static_cast<double>(angle))), 6e-8F) << angle;
      ASSERT_NEAR(ours.cos, static_cast<float>(std::cos(static_cast<double>(angle))), 6e-8F) << angle;
    }
  }
  EXPECT_EQ(sin_cos(INFINITY).cos, 1.0F);
  EXPECT_EQ(sin_cos(NAN).sin, 0.0F);
}

}  // namespace
}  // namespace takt::pipeline
