// SPDX-License-Identifier: Apache-2.0
// Element-wise mathematics in whole registers.
//
// The transcendental functions are Eigen's packet polynomials. Remainders go through a padded register too, so that an
// element's bits depend on its value alone, not on its place in the array and not on the C library's choice of variant.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstring>

namespace takt::onnx_engine {

using Lane = Eigen::Array<float, 8, 1>;

inline Lane load_lane(const float* from) noexcept {
  Lane lane;
  std::memcpy(lane.data(), from, sizeof(float) * 8);
  return lane;
}

inline void store_lane(const Lane& lane, float* to) noexcept {
  std::memcpy(to, lane.data(), sizeof(float) * 8);
}

// out[i] = function(in[i]); `in` and `out` may be the same array.
template <class Function>
void map_lanes(const float* in, float* out, std::size_t count, Function function) noexcept {
  constexpr std::size_t width = Lane::SizeAtCompileTime;
  std::size_t i = 0;
  for (; i + width <= count; i += width) store_lane(function(load_lane(in + i)), out + i);
  if (i < count) {
    Lane rest = Lane::Zero();
    std::memcpy(rest.data(), in + i, (count - i) * sizeof(float));
    rest = function(rest);
    std::memcpy(out + i, rest.data(), (count - i) * sizeof(float));
  }
}

// Not a number passes through every one of these; Eigen's plain min() and max() would swallow it.
inline Lane lane_max(const Lane& x, const Lane& y) noexcept {
  return x.binaryExpr(y, Eigen::internal::scalar_max_op<float, float, Eigen::PropagateNaN>());
}
inline Lane lane_min(const Lane& x, const Lane& y) noexcept {
  return x.binaryExpr(y, Eigen::internal::scalar_min_op<float, float, Eigen::PropagateNaN>());
}
inline Lane lane_relu(const Lane& x) noexcept {
  return lane_max(x, Lane::Zero());
}
inline Lane lane_exp(const Lane& x) noexcept {
  return x.exp();
}
inline Lane lane_tanh(const Lane& x) noexcept {
  return x.tanh();
}
inline Lane lane_sigmoid(const Lane& x) noexcept {
  return (1.0F + (-x).exp()).inverse();
}
// Both halves are exact where the other one applies: no branch, no cancellation above zero.
inline Lane lane_elu(const Lane& x, float alpha) noexcept {
  return lane_relu(x) + alpha * (lane_min(x, Lane::Zero()).exp() - 1.0F);
}

}  // namespace takt::onnx_engine
