#include "evidence/rollout/troubled_dynamics.hpp"

#include <cmath>
#include <utility>

#include "evidence/rollout/random.hpp"

namespace takt::panel {
namespace {

constexpr std::uint64_t kPushStream = 401;

}  // namespace

config::Vector3 push_direction(std::uint64_t seed, std::int64_t turn) {
  Random random(plant::seed_for(seed, kPushStream), static_cast<std::uint64_t>(turn));
  const config::Vector3 drawn{random.normal(), random.normal(), random.normal()};
  const double length = std::hypot(drawn[0], drawn[1], drawn[2]);
  return {drawn[0] / length, drawn[1] / length, drawn[2] / length};
}

TroubledDynamics::TroubledDynamics(std::unique_ptr<plant::TroubledMechanics> body, const Disturbance& disturbance,
                                   MonoTime started, std::uint64_t seed)
    : body_(std::move(body)), disturbance_(disturbance), now_(started), seed_(seed) {}

std::expected<std::unique_ptr<TroubledDynamics>, std::string> TroubledDynamics::make(const config::RobotConfig& robot,
                                                                                     const Disturbance& disturbance,
                                                                                     MonoTime started,
                                                                                     std::uint64_t seed) {
  std::vector<double> payloads;
  if (disturbance.trouble() == Trouble::payload)
    payloads.push_back(disturbance.dose(Trouble::payload, disturbance.begins()));
  auto body = plant::TroubledMechanics::make(robot, payloads);
  if (!body) return std::unexpected(body.error());
  return std::unique_ptr<TroubledDynamics>(new TroubledDynamics(std::move(*body), disturbance, started, seed));
}

plant::BodyTrouble TroubledDynamics::trouble_now() const {
  plant::BodyTrouble trouble;
  const std::int64_t turn = disturbance_.turn(Trouble::push, now_);
  if (turn != 0 && now_ - disturbance_.begins() - kRepeat * (turn - 1) < kPushLength) {
    trouble.towards = push_direction(seed_, turn);
    trouble.force = disturbance_.dose(Trouble::push, now_);
  }
  trouble.payload = disturbance_.dose(Trouble::payload, now_);
  if (const double factor = disturbance_.dose(Trouble::friction, now_); factor > 0) trouble.friction = factor;
  return trouble;
}

void TroubledDynamics::integrate(plant::ArmState& state, const Eigen::VectorXd& tau,
                                 const std::vector<plant::Friction>& friction, Duration step) {
  body_->set(trouble_now());
  body_->integrate(state, tau, friction, step);
  now_ = now_ + step;
}

}  // namespace takt::panel
