// SPDX-License-Identifier: Apache-2.0
// Sine and cosine with the same bits on every machine: the C library picks its variant by CPU (with or without fused
// multiply-add), and replay promises equal bits. Absolute error below 6e-8 for |angle| <= 1e5; anything not finite or
// larger gives (0, 1).
// Method: reduction by multiples of pi/2 in two parts (Cody and Waite), then Taylor series on [-pi/4, pi/4].
#pragma once

#include <cmath>
#include <cstdint>

namespace takt::pipeline {

struct SinCos {
  float sin = 0.0F;
  float cos = 1.0F;
};

inline SinCos sin_cos(float angle) {
  if (!(std::abs(angle) <= 1.0e5F)) return {};
  constexpr double kTwoOverPi = 0.63661977236758134308;
  constexpr double kPiHalfHigh = 1.57079632673412561417;  // pi/2, first 33 bits
  constexpr double kPiHalfLow = 6.07710050650619224932e-11;
  const double x = static_cast<double>(angle);
  const double scaled = x * kTwoOverPi;
  const auto quarter = static_cast<std::int32_t>(scaled < 0 ? scaled - 0.5 : scaled + 0.5);
  const double turns = static_cast<double>(quarter);
  const double r = (x - turns * kPiHalfHigh) - turns * kPiHalfLow;
  const double z = r * r;
  const double s = r * (1.0 + z * (-1.0 / 6 + z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880)))));
  const double c = 1.0 + z * (-0.5 + z * (1.0 / 24 + z * (-1.0 / 720 + z * (1.0 / 40320 + z * (-1.0 / 3628800)))));
  const auto sf = static_cast<float>(s);
  const auto cf = static_cast<float>(c);
  switch (static_cast<unsigned>(quarter) & 3U) {
    case 0:
      return {sf, cf};
    case 1:
      return {cf, -sf};
    case 2:
      return {-sf, -cf};
    default:
      return {-cf, sf};
  }
}

}  // namespace takt::pipeline
