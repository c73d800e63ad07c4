// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/troubled_dynamics.hpp"

#include <cmath>
#include <utility>

#include "evidence/rollout/random.hpp"

namespace takt::evidence {
namespace {

constexpr std::uint64_t kPushStream = 401;

}  // namespace

config::Vector3 push_direction(std::uint64_t seed, std::int64_t turn) {
  Random random(simulation::seed_for(seed, kPushStream), static_cast<std::uint64_t>(turn));
  const config::Vector3 drawn{random.normal(), random.normal(), random.normal()};
  const double length = std::hypot(drawn[0], drawn[1], drawn[2]);
  return {drawn[0] / length, drawn[1] / length, drawn[2] / length};
}

namespace {

// What is asked of a world that it cannot do; empty: nothing.
std::string beyond(const simulation::OutsideMechanics& outside, const Disturbance& disturbance) {
  const std::string& world = outside.link().world();
  if (disturbance.has(Trouble::payload)) return "payload: world " + world + " has masses of its own";
  if (disturbance.has(Trouble::push) && !outside.link().gives(TAKT_WORLD_PUSH))
    return "push: world " + world + " does not push (docs/world-protocol.md)";
  return {};
}

}  // namespace

TroubledDynamics::TroubledDynamics(std::unique_ptr<simulation::TroubledMechanics> body,
                                   simulation::OutsideMechanics* outside, const Disturbance& disturbance,
                                   MonoTime started, std::uint64_t seed)
    : body_(std::move(body)), outside_(outside), disturbance_(disturbance), now_(started), seed_(seed) {}

std::expected<std::unique_ptr<TroubledDynamics>, std::string> TroubledDynamics::make(
    const config::RobotConfig& robot, const Disturbance& disturbance, MonoTime started, std::uint64_t seed,
    std::unique_ptr<simulation::OutsideMechanics> outside) {
  if (outside) {
    if (const std::string why = beyond(*outside, disturbance); !why.empty()) return std::unexpected(why);
    simulation::OutsideMechanics* const played = outside.get();
    return std::unique_ptr<TroubledDynamics>(new TroubledDynamics(
        simulation::TroubledMechanics::around(std::move(outside), robot), played, disturbance, started, seed));
  }
  std::vector<double> payloads;
  if (disturbance.has(Trouble::payload))
    payloads.push_back(disturbance.dose(Trouble::payload, disturbance.begins(Trouble::payload)));
  auto body = simulation::TroubledMechanics::make(robot, payloads);
  if (!body) return std::unexpected(body.error());
  for (const Trouble trouble : {Trouble::push, Trouble::payload})
    if (!(*body)->has_body(disturbance.body(trouble)))
      return std::unexpected(robot.file + ": has no body " + disturbance.body(trouble) +
                             " to push or load; name one of its MJCF");
  return std::unique_ptr<TroubledDynamics>(new TroubledDynamics(std::move(*body), nullptr, disturbance, started, seed));
}

std::expected<TroubledRobot, std::string> TroubledRobot::make(const config::RobotConfig& robot,
                                                              const Disturbance& disturbance, MonoTime started,
                                                              std::uint64_t seed,
                                                              std::unique_ptr<simulation::OutsideMechanics> outside) {
  auto made = TroubledDynamics::make(robot, disturbance, started, seed, std::move(outside));
  if (!made) return std::unexpected(made.error());
  TroubledDynamics& dynamics = **made;
  auto plant = simulation::Plant::make(robot, std::move(*made));
  if (!plant) return std::unexpected(plant.error());
  if (dynamics.outside() != nullptr) plant->set_state(dynamics.outside()->begin());
  return TroubledRobot{std::move(*plant), dynamics};
}

simulation::BodyTrouble TroubledDynamics::trouble_now() const {
  simulation::BodyTrouble trouble;
  const std::int64_t turn = disturbance_.turn(Trouble::push, now_);
  if (turn != 0 && now_ - disturbance_.begins(Trouble::push) - kRepeat * (turn - 1) < kPushLength) {
    trouble.towards = push_direction(seed_, turn);
    trouble.force = disturbance_.dose(Trouble::push, now_);
  }
  trouble.payload = disturbance_.dose(Trouble::payload, now_);
  trouble.pushed = disturbance_.body(Trouble::push);
  trouble.loaded = disturbance_.body(Trouble::payload);
  if (const double factor = disturbance_.dose(Trouble::friction, now_); factor > 0) trouble.friction = factor;
  return trouble;
}

void TroubledDynamics::integrate(simulation::ArmState& state, const Eigen::VectorXd& tau,
                                 const std::vector<simulation::Friction>& friction, Duration step) {
  body_->set(trouble_now());
  body_->integrate(state, tau, friction, step);
  now_ = now_ + step;
}

}  // namespace takt::evidence
