// SPDX-License-Identifier: Apache-2.0
// Goal: run() takes nothing from the heap. Method: every allocation function of this program counts; a model of all
// operator families runs between two readings. A planted allocation shows that the counter counts.
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <memory>
#include <new>

#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
}

namespace {
std::atomic<long> allocations{0};
}

// Eigen and the C library allocate through malloc, operator new ends there too.
extern "C" {
void* malloc(std::size_t size) noexcept {
  allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
  allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_calloc(count, size);
}
void* realloc(void* memory, std::size_t size) noexcept {
  allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_realloc(memory, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_memalign(alignment, size);
}
}

namespace takt::onnx_engine {
namespace {

GraphMaker every_family() {
  GraphMaker maker(17);
  const std::vector<float> tenth(64 * 64, 0.1F);
  const auto some = [&tenth](std::size_t n) {
    return std::vector<float>(tenth.begin(), tenth.begin() + static_cast<std::ptrdiff_t>(n));
  };
  maker.input("x", {4, 1, 64}).output("y").output("z");
  maker.floats("w", {64, 64}, tenth).floats("scale", {64}, some(64)).integers("rows", {2}, {4, 64});
  maker.floats("lw", {1, 64, 64}, tenth).floats("lr", {1, 64, 16}, some(64 * 16));
  maker.floats("gw", {1, 48, 64}, some(48 * 64)).floats("gr", {1, 48, 16}, some(48 * 16));
  maker.integers("two", {1}, {2}).integers("zero", {1}, {0}).integers("index", {1}, {1});
  maker.node("LayerNormalization", {"x", "scale"}, {"n"});
  maker.node("Reshape", {"n", "rows"}, {"m"});
  maker.node("Gemm", {"m", "w", "scale"}, {"g"}).with("transA", std::int64_t{0}).with("transB", std::int64_t{1});
  maker.node("Elu", {"g"}, {"e"});
  maker.node("Transpose", {"e"}, {"t"});
  maker.node("MatMul", {"e", "t"}, {"p"});
  maker.node("Softmax", {"p"}, {"s"});
  maker.node("ReduceMean", {"s"}, {"mean"}).with("axes", Dims{1});
  maker.node("Mul", {"s", "mean"}, {"q"});
  maker.node("Pow", {"q", "q"}, {"pow"});
  maker.node("Slice", {"pow", "zero", "two"}, {"cut"});
  maker.node("Gather", {"pow", "index"}, {"row"});
  maker.node("Concat", {"cut", "row"}, {"y"}).with("axis", std::int64_t{0});
  maker.node("LSTM", {"x", "lw", "lr"}, {"", "h"}).with("hidden_size", std::int64_t{16});
  maker.node("GRU", {"x", "gw", "gr", "", "", "h"}, {"z"}).with("hidden_size", std::int64_t{16});
  maker.integers("picture", {4}, {1, 4, 8, 8}).floats("kernels", {2, 4, 3, 3}, some(72)).floats("one", {1}, {1});
  maker.output("chosen").output("row of a step").input("step", {1});
  maker.node("Reshape", {"x", "picture"}, {"plane"});
  maker.node("Conv", {"plane", "kernels"}, {"folded"});
  maker.node("MaxPool", {"folded"}, {"largest"}).with("kernel_shape", Dims{2, 2});
  maker.node("AveragePool", {"largest"}, {"average"}).with("kernel_shape", Dims{2, 2});
  maker.node("Split", {"average"}, {"left", "right"}).with("axis", std::int64_t{1});
  maker.node("ReduceL2", {"left"}, {"length"});
  maker.node("Max", {"right", "length", "one"}, {"most"});
  maker.node("Less", {"left", "most"}, {"less"});
  maker.node("Where", {"less", "left", "most"}, {"chosen"});
  maker.node("Cast", {"step"}, {"index of a step"}).with("to", std::int64_t{onnx::TensorProto_DataType_INT64});
  maker.node("Gather", {"w", "index of a step"}, {"row of a step"});
  return maker;
}

TEST(Allocation, TheCounterSeesOperatorNewAndMalloc) {
  const long before = allocations.load();
  const auto planted = std::make_unique<float[]>(3);
  std::free(std::aligned_alloc(64, 64));
  EXPECT_NE(planted, nullptr);
  EXPECT_GE(allocations.load() - before, 2);
}

TEST(Allocation, RunTakesNothingFromTheHeap) {
  auto model = every_family().load();
  ASSERT_TRUE(model) << model.error();
  std::ranges::fill(model->input(0), 0.25F);
  const long before = allocations.load();
  for (int i = 0; i < 3; ++i) model->run();
  EXPECT_EQ(allocations.load() - before, 0);
}

}  // namespace
}  // namespace takt::onnx_engine
