// SPDX-License-Identifier: Apache-2.0
#include "lab/study/injected_sine.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace takt::study {
namespace {

// Of each joint's limits: far from every barrier, and from the slew limit.
constexpr double kShareOfSpeed = 0.15, kShareOfTorque = 0.2, kShareOfSlew = 0.3;
constexpr double kSwing = 0.02;  // rad: some fifty steps of the encoder, and gravity is still straight
constexpr double kPeriods = 8, kLeast_s = 0.3;

}  // namespace

std::complex<double> sine_in(std::span<const double> samples, double omega, double step_s, std::size_t first) {
  const auto count = static_cast<Eigen::Index>(samples.size());
  Eigen::MatrixXd shapes(count, 4);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double phase = omega * step_s * (static_cast<double>(first) + static_cast<double>(i));
    const double drift = 2 * static_cast<double>(i) / static_cast<double>(count) - 1;
    shapes.row(i) << std::sin(phase), std::cos(phase), 1, drift;
  }
  const Eigen::Map<const Eigen::VectorXd> seen(samples.data(), count);
  const Eigen::Vector4d fit = shapes.colPivHouseholderQr().solve(seen);
  return {fit[0], fit[1]};
}

double InjectedSine::amplitude(std::size_t joint, double omega) const {
  const Eigen::VectorXcd moved = expected_.disturbed(joint, omega);
  const Eigen::Index n = moved.size() / 2;
  double most = 1e9;
  for (Eigen::Index i = 0; i < n; ++i) {
    const config::Limits& limits = robot_.joints[static_cast<std::size_t>(i)].limits;
    most = std::min({most, kSwing / std::abs(moved[i]), kShareOfSpeed * limits.velocity / std::abs(moved[n + i])});
  }
  const std::complex<double> loop = expected_.loop(joint, omega);
  const double answer = std::abs(loop / (1.0 + loop));
  const config::Limits& limits = robot_.joints[joint].limits;
  return std::min(
      {most, kShareOfTorque * limits.torque / answer, kShareOfSlew * limits.torque_rate / (answer * omega)});
}

std::complex<double> InjectedSine::response(std::size_t joint, double omega) {
  const config::Joint& settings = robot_.joints[joint];
  const double period_s = 2 * std::numbers::pi / omega;
  const double relaxes_s = settings.kp > 0 ? 10 * settings.kd / settings.kp : 0;
  const double settling_s = std::max({kLeast_s, relaxes_s, 2 * period_s}),
               window_s = std::max(kLeast_s, kPeriods * period_s);
  loop_.probe().inject(joint, amplitude(joint, omega), omega);
  loop_.run({std::llround(settling_s * 1e9)});
  (void)loop_.trouble();
  const std::size_t first = loop_.probe().record().total.size();
  loop_.run({std::llround(window_s * 1e9)});
  if (const std::string what = loop_.trouble(); !what.empty()) trouble_ = what;
  const ProbeRecord& seen = loop_.probe().record();
  const double step_s = expected_.step().seconds();
  const auto fit = [&](const std::vector<double>& torque) {
    return sine_in(std::span(torque).subspan(first), omega, step_s, first);
  };
  return -fit(seen.control) / fit(seen.total);
}

}  // namespace takt::study
