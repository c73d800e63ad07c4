// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_runtime/stored_numbers.hpp"

#include <Eigen/Core>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <limits>

namespace takt::onnx_runtime {

namespace {

struct Truth {
  std::uint8_t value;
};

// `use(Number{})` with the type that `element` is; false: it is none.
template <class Use>
bool with_type(int element, Use use) noexcept {
  switch (element) {
    case 2:
      return use(std::uint8_t{});
    case 3:
      return use(std::int8_t{});
    case 4:
      return use(std::uint16_t{});
    case 5:
      return use(std::int16_t{});
    case 6:
      return use(std::int32_t{});
    case 7:
      return use(std::int64_t{});
    case 9:
      return use(Truth{});
    case 10:
      return use(Eigen::half{});
    case kFloat32:
      return use(float{});
    case 11:
      return use(double{});
    case 12:
      return use(std::uint32_t{});
    case 13:
      return use(std::uint64_t{});
    case 16:
      return use(Eigen::bfloat16{});
    default:
      return false;
  }
}

template <std::integral Whole>
bool fits(float value) noexcept {
  // The bounds as floats are powers of two, or 0: exact.
  constexpr auto low = static_cast<float>(std::numeric_limits<Whole>::lowest());
  constexpr Whole half = std::numeric_limits<Whole>::max() / 2 + 1;
  constexpr float high = static_cast<float>(half) * 2.0F;
  return std::trunc(value) >= low && value < high;  // NaN is neither
}

bool convert(float from, Truth& to) noexcept {
  to.value = from == 0.0F ? 0 : 1;
  return !std::isnan(from);
}
template <std::integral Whole>
bool convert(float from, Whole& to) noexcept {
  if (!fits<Whole>(from)) return false;
  to = static_cast<Whole>(from);
  return true;
}
template <class Real>
bool convert(float from, Real& to) noexcept {
  to = static_cast<Real>(from);
  return true;
}

float as_float(Truth from) noexcept {
  return from.value == 0 ? 0.0F : 1.0F;
}
template <class Number>
float as_float(Number from) noexcept {
  return static_cast<float>(from);
}

}  // namespace

std::size_t stored_bytes(int element) noexcept {
  std::size_t bytes = 0;
  with_type(element, [&](auto number) {
    bytes = sizeof number;
    return true;
  });
  return bytes;
}

bool store(std::span<const float> from, int element, std::span<std::byte> to) noexcept {
  return with_type(element, [&](auto number) {
    for (std::size_t i = 0; i < from.size(); ++i) {
      if (!convert(from[i], number)) return false;
      std::memcpy(to.data() + i * sizeof number, &number, sizeof number);
    }
    return true;
  });
}

void read(std::span<const std::byte> from, int element, std::span<float> to) noexcept {
  with_type(element, [&](auto number) {
    for (std::size_t i = 0; i < to.size(); ++i) {
      std::memcpy(&number, from.data() + i * sizeof number, sizeof number);
      to[i] = as_float(number);
    }
    return true;
  });
}

}  // namespace takt::onnx_runtime
