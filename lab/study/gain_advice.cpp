// SPDX-License-Identifier: Apache-2.0
#include "lab/study/gain_advice.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "config/joint_units.hpp"
#include "lab/study/inner_loop.hpp"

namespace takt::study {
namespace {

// What runs may have a little less than what is computed; and gains with little gain margin are no remedy.
constexpr double kWanted_rad = kLeastPhase_rad + std::numbers::pi / 180;
constexpr double kLeastGain = 2;
constexpr double kStride = 0.05, kLeastShare = 0.1;
constexpr int kPoints = 120, kRefinements = 10;

struct Gains {
  double kp = 0, kd = 0;
};

// As a person would write it.
double two_digits(double value) {
  if (value <= 0) return 0;
  const double digit = std::pow(10.0, std::floor(std::log10(value)) - 1);
  return digit * std::round(value / digit);
}

class Trial {
 public:
  Trial(const config::RobotConfig& robot, std::size_t joint, const DynamicsMaker& dynamics, const Eigen::VectorXd& pose)
      : robot_(robot), joint_(joint), dynamics_(dynamics), pose_(pose) {}

  bool suffices(const Gains& gains) {
    robot_.joints[joint_].kp = gains.kp;
    robot_.joints[joint_].kd = gains.kd;
    auto mechanics = dynamics_(robot_);
    if (!mechanics) return false;
    const auto loop = InnerLoop::make(robot_, **mechanics, pose_);
    if (!loop) return false;
    const LoopMargins found = margins_of([&](double omega) { return loop->loop(joint_, omega); },
                                         sweep_of(loop->step(), kPoints, kRefinements));
    return found.phase_rad && *found.phase_rad >= kWanted_rad && (!found.gain || *found.gain >= kLeastGain);
  }

 private:
  config::RobotConfig robot_;
  std::size_t joint_;
  const DynamicsMaker& dynamics_;
  const Eigen::VectorXd& pose_;
};

std::string kd_text(const Gains& from, const Gains& to, config::JointKind kind) {
  return fmt::format("gains.kd from {:g} to {:g} {}", from.kd, to.kd, config::kJointDamping.unit(kind));
}

std::string lowered(const Gains& from, const Gains& to, config::JointKind kind) {
  const std::string kp = fmt::format("gains.kp from {:g} to {:g} {}", from.kp, to.kp,
                                     config::kJointStiffness.unit(kind)),
                    kd = kd_text(from, to, kind);
  if (to.kp == from.kp) return "lower " + kd;
  return "lower " + kp + (to.kd == from.kd ? "" : " and " + kd);
}

}  // namespace

std::string gain_advice(const config::RobotConfig& robot, std::size_t joint, const DynamicsMaker& dynamics,
                        const Eigen::VectorXd& pose) {
  const config::Joint& settings = robot.joints[joint];
  if (!not_computable(settings).empty()) return "tune the loop inside its drive";
  const Gains now{settings.kp, settings.kd};
  Trial trial(robot, joint, dynamics, pose);
  for (int i = 1; now.kd > 0 && now.kd * (1 + kStride * i) <= settings.limits.kd; ++i) {
    const Gains more{now.kp, two_digits(now.kd * (1 + kStride * i))};
    if (more.kd <= settings.limits.kd && trial.suffices(more)) return "raise " + kd_text(now, more, settings.kind);
  }
  for (int i = 1; 1 - kStride * i >= kLeastShare; ++i) {
    const Gains less{two_digits(now.kp * (1 - kStride * i)), two_digits(now.kd * (1 - kStride * i))};
    for (const Gains& tried : {Gains{less.kp, now.kd}, less})
      if (trial.suffices(tried)) return lowered(now, tried, settings.kind);
  }
  return "no lower kp or kd corrects it; take delay out of its loop (drive, bus, observer_bandwidth)";
}

}  // namespace takt::study
