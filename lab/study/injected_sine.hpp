// SPDX-License-Identifier: Apache-2.0
// The frequency response of a loop that really runs: a sine is added to the torque of one joint, and once the transient
// is over, what the loop answers is compared with what the joint got, L = -answer / got. Source: the usual
// loop-breaking injection at the plant's input, without breaking the loop.
#pragma once

#include <complex>
#include <span>
#include <string>

#include "config/robot_config.hpp"
#include "lab/study/holding_loop.hpp"
#include "lab/study/inner_loop.hpp"

namespace takt::study {

// The sine of this frequency in `samples`, beside an offset and a drift: least squares, so that the window need not
// hold whole periods. Complex amplitude: the real part goes with sin. `first`: index of the first sample in the sine's
// count.
std::complex<double> sine_in(std::span<const double> samples, double omega, double step_s, std::size_t first);

class InjectedSine {
 public:
  // `expected` only chooses how large the sine may be: small enough for limits, large enough for the encoder.
  InjectedSine(const config::RobotConfig& robot, HoldingLoop& loop, const InnerLoop& expected)
      : robot_(robot), loop_(loop), expected_(expected) {}

  std::complex<double> response(std::size_t joint, double omega);
  // Of the measurements so far, the latest thing that spoiled one; empty: none.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }

 private:
  [[nodiscard]] double amplitude(std::size_t joint, double omega) const;

  const config::RobotConfig& robot_;
  HoldingLoop& loop_;
  const InnerLoop& expected_;
  std::string trouble_;
};

}  // namespace takt::study
