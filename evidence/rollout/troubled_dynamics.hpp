// When a perturbation troubles a robot's mechanics: a push at the tool, a payload, more friction
// (simulation/troubled_mechanics.hpp says what each is). Everything else passes through.
// Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <expected>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "evidence/rollout/perturbation.hpp"
#include "simulation/troubled_mechanics.hpp"

namespace takt::panel {

inline constexpr Duration kPushLength = milliseconds(100);
// Of the push in that second of the window, from 1: drawn from the seed. Length 1.
config::Vector3 push_direction(std::uint64_t seed, std::int64_t turn);

class TroubledDynamics final : public plant::Mechanics {
 public:
  // `disturbance` outlives this. The error is one sentence: the robot has no model the simulator knows.
  static std::expected<std::unique_ptr<TroubledDynamics>, std::string> make(const config::RobotConfig& robot,
                                                                            const Disturbance& disturbance,
                                                                            MonoTime started, std::uint64_t seed);

  void integrate(plant::ArmState& state, const Eigen::VectorXd& tau, const std::vector<plant::Friction>& friction,
                 Duration step) override;
  config::Vector3 tool_position(const Eigen::VectorXd& q) override { return body_->tool_position(q); }
  config::Vector3 controlled_point(const Eigen::VectorXd& q) override { return body_->controlled_point(q); }
  std::optional<plant::ImuReading> imu() override { return body_->imu(); }
  [[nodiscard]] std::optional<plant::BasePose> base() const override { return body_->base(); }
  void hoist(bool hangs) override { body_->hoist(hangs); }

 private:
  TroubledDynamics(std::unique_ptr<plant::TroubledMechanics> body, const Disturbance& disturbance, MonoTime started,
                   std::uint64_t seed);
  [[nodiscard]] plant::BodyTrouble trouble_now() const;

  std::unique_ptr<plant::TroubledMechanics> body_;
  const Disturbance& disturbance_;
  MonoTime now_;
  std::uint64_t seed_;
};

}  // namespace takt::panel
