// SPDX-License-Identifier: Apache-2.0
// Goal: networks of equal weights keep one copy of them, others their own, and nothing outlives the networks.
// Method: the weights as a network packs them are offered to the pool while none, one or two networks that use them are
// alive; what comes back is ours, or theirs.
#include <algorithm>

#include "policy_host/onnx_engine/constant_pool.hpp"
#include "policy_host/onnx_engine/panels.hpp"
#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

namespace takt::onnx_engine {
namespace {

constexpr std::size_t kInner = 3, kColumns = 2;
const std::vector<float> weights{1, 0, 0, 1, 1, 1};
const std::vector<float> others{1, 0, 0, 1, 1, -1};

FloatBuffer packed(const std::vector<float>& matrix) {
  FloatBuffer floats = allocate_floats(packed_size(kInner, kColumns));
  pack_panels(matrix.data(), kInner, kColumns, kColumns, 1, floats.get());
  return floats;
}

SharedFloats offer(const std::vector<float>& matrix) {
  return share_constant(packed(matrix), packed_size(kInner, kColumns));
}

// True: a living network has these weights already.
bool is_known(const std::vector<float>& matrix) {
  FloatBuffer floats = packed(matrix);
  const float* const ours = floats.get();
  return share_constant(std::move(floats), packed_size(kInner, kColumns)).get() != ours;
}

Model network() {
  GraphMaker maker;
  maker.input("a", {1, 3}).output("y").floats("b", {3, 2}, weights).node("MatMul", {"a", "b"}, {"y"});
  return maker.load().value();
}

TEST(ConstantPool, EqualArraysAreOne) {
  const SharedFloats first = offer(weights), second = offer(weights);
  EXPECT_EQ(first, second);
  EXPECT_NE(offer(others), first);
}

TEST(ConstantPool, MinusZeroIsAnotherConstantThanZero) {
  const std::vector<float> minus{1, -0.0F, 0, 1, 1, 1};
  const SharedFloats first = offer(weights);
  EXPECT_NE(offer(minus), first);
}

TEST(ConstantPool, AnArrayIsNotTheBeginningOfALongerOne) {
  FloatBuffer longer = allocate_floats(32), shorter = allocate_floats(16);
  const SharedFloats first = share_constant(std::move(longer), 32);
  EXPECT_NE(share_constant(std::move(shorter), 16), first);
}

TEST(ConstantPool, HoldsTheWeightsOfANetworkForAsLongAsOneLives) {
  EXPECT_FALSE(is_known(weights));
  {
    Model survivor = network();
    {
      const Model passing = network();
      EXPECT_TRUE(is_known(weights));
    }
    EXPECT_TRUE(is_known(weights));
    EXPECT_FALSE(is_known(others));
    std::ranges::copy(std::vector<float>{1, 2, 3}, survivor.input(0).begin());
    survivor.run();
    EXPECT_EQ(survivor.output(0)[0], 4);
    EXPECT_EQ(survivor.output(0)[1], 5);
  }
  EXPECT_FALSE(is_known(weights));
}

}  // namespace
}  // namespace takt::onnx_engine
