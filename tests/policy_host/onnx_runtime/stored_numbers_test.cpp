// SPDX-License-Identifier: Apache-2.0
// Goal: floats become what a model's tensor holds and come back, and what a type does not hold is refused rather than
// wrapped. Method: every type of numbers that ONNX Runtime has, at and beyond its ends.
#include "policy_host/onnx_runtime/stored_numbers.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace takt::onnx_runtime {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// `from` stored and read again; NaN: refused.
float there_and_back(int element, float from) {
  std::vector<std::byte> bytes(stored_bytes(element));
  float back = kNan;
  if (store({&from, 1}, element, bytes)) read(bytes, element, {&back, 1});
  return back;
}

TEST(StoredNumbers, WholeNumbersAreCutAndKeptWithinTheirType) {
  struct Whole {
    int element;
    float lowest, beyond;  // of what it holds, and the first power of two above
  };
  for (const Whole& type :
       {Whole{2, 0, 256}, Whole{3, -128, 128}, Whole{4, 0, 65536}, Whole{5, -32768, 32768}, Whole{6, -0x1p31F, 0x1p31F},
        Whole{7, -0x1p63F, 0x1p63F}, Whole{12, 0, 0x1p32F}, Whole{13, 0, 0x1p64F}}) {
    SCOPED_TRACE(type.element);
    EXPECT_EQ(there_and_back(type.element, 7.9F), 7.0F);
    EXPECT_EQ(there_and_back(type.element, type.lowest), type.lowest);
    EXPECT_EQ(there_and_back(type.element, -0.9F), 0.0F);
    EXPECT_TRUE(std::isnan(there_and_back(type.element, type.beyond)));
    EXPECT_TRUE(std::isnan(there_and_back(type.element, 2 * type.lowest - 2)));
    EXPECT_TRUE(std::isnan(there_and_back(type.element, kNan)));
    const float last = std::nextafter(type.beyond, 0.0F);
    EXPECT_EQ(there_and_back(type.element, last), std::trunc(last));
  }
}

TEST(StoredNumbers, TruthsAreZeroAndOneAndNeverNaN) {
  EXPECT_EQ(there_and_back(9, 0.0F), 0.0F);
  EXPECT_EQ(there_and_back(9, -0.25F), 1.0F);
  EXPECT_TRUE(std::isnan(there_and_back(9, kNan)));
}

TEST(StoredNumbers, RealNumbersAreRounded) {
  for (const int element : {1, 10, 11, 16}) {
    SCOPED_TRACE(element);
    EXPECT_EQ(there_and_back(element, -1.5F), -1.5F);
    EXPECT_TRUE(std::isnan(there_and_back(element, kNan)));
  }
  EXPECT_EQ(there_and_back(11, 0.1F), 0.1F);
  EXPECT_NEAR(there_and_back(10, 0.1F), 0.1F, 1e-4F);
}

TEST(StoredNumbers, WhatIsNoNumberHasNoSize) {
  for (const int element : {0, 8, 14, 15, 17, 21, 99}) EXPECT_EQ(stored_bytes(element), 0U) << element;
}

}  // namespace
}  // namespace takt::onnx_runtime
