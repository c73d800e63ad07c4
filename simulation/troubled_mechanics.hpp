// SPDX-License-Identifier: Apache-2.0
// A robot's mechanics with what the world adds: a force, a point mass, more friction in the joints. Both act at the
// tool; that of a cart with a pole is the pole's tip. In MuJoCo they act at any body by name, by themselves at the
// root; there the mass is at the body's centre of mass. Everything else passes through. Units: N, kg, base frame.
// Thread rule: one thread at a time. Source of the force's joint torques: the transposed Jacobian, by central
// differences of the tool's position.
#pragma once

#include <expected>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "config/robot_config.hpp"
#include "simulation/mechanics.hpp"

namespace takt::simulation {

struct BodyTrouble {
  config::Vector3 towards{};  // length 1; of the force
  double force = 0;
  double payload = 0;              // 0: none
  std::string pushed{}, loaded{};  // names of bodies; empty: the tool, or the root
  double friction = 1;             // times that of the robot file, in joints that are not passive
};

class TroubledMechanics final : public Mechanics {
 public:
  // `payloads`: the masses at the tool that set() may ask for. The error is one sentence: the robot has no model the
  // simulator knows.
  static std::expected<std::unique_ptr<TroubledMechanics>, std::string> make(const config::RobotConfig& robot,
                                                                             std::span<const double> payloads);
  // Around mechanics that are there already, of `robot`: no payloads.
  static std::unique_ptr<TroubledMechanics> around(std::unique_ptr<Mechanics> bare, const config::RobotConfig& robot);

  // From the next step on. Precondition: a payload at the tool that make() was told of, or none; bodies that there are.
  void set(const BodyTrouble& trouble);
  void integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                 Duration step) override;
  // As without a payload.
  config::Vector3 tool_position(const Eigen::VectorXd& q) override { return bare_->tool_position(q); }
  config::Vector3 controlled_point(const Eigen::VectorXd& q) override { return bare_->controlled_point(q); }
  std::optional<ImuReading> imu() override { return bare_->imu(); }
  [[nodiscard]] std::optional<BasePose> base() const override { return bare_->base(); }
  [[nodiscard]] std::vector<std::string> notes() const override { return bare_->notes(); }
  void hoist(bool hangs) override { bare_->hoist(hangs); }
  [[nodiscard]] bool has_body(const std::string& name) const override { return bare_->has_body(name); }

 private:
  TroubledMechanics(std::unique_ptr<Mechanics> bare, const config::RobotConfig& robot);
  [[nodiscard]] Eigen::VectorXd torque_of_force(const Eigen::VectorXd& q);
  [[nodiscard]] std::vector<Friction> with_more(std::vector<Friction> friction) const;

  std::unique_ptr<Mechanics> bare_;
  std::vector<std::pair<double, std::unique_ptr<Mechanics>>> loaded_;  // by payload
  Mechanics* body_;                                                    // the one of the payload that is set
  std::vector<Friction> own_friction_;  // the robot file's, by joint; passive ones have none
  BodyTrouble trouble_;
};

}  // namespace takt::simulation
