// SPDX-License-Identifier: Apache-2.0
// Built-in ONNX engine: loads a policy network once, then evaluates it with the same bits for the same input.
//
//   auto model = onnx_engine::load("policy.onnx");          // std::expected: the error is one line, with the cure
//   std::ranges::copy(observation, model->input(0).begin());
//   model->run();
//   use(model->output(0));
//
// Shapes: fixed at load; a symbolic batch dimension becomes 1. Tensors are row-major float32 at the boundary:
// whole numbers (int32, int64) are written and read as floats, exact up to 2^24, and cut to whole ones; truths are 0
// and 1; float64 is rounded. Memory of one model is capped at 1 GiB. Input elements are zero until written.
//
// Operators: ONNX opset 1 to 21 (older than 8: lifted, lift.hpp), those that operators.cpp lists. Anything else is
// refused at load, never at run().
// Weights may lie beside the model (external data), in FILE.data or FILE_data.
// Not a number in an input reaches every output that depends on it: no operator swallows it.
//
// Threads: one thread at a time per Model. run() allocates nothing, takes no lock and cannot fail.
//
// Bits: every sum runs in ascending index order, one rounding per product and one per addition; exp, tanh and the
// logistic function are polynomials evaluated in the same registers for every element. One binary gives the same bits
// on every x86-64 machine, except for what calls the C library: Erf, Pow with an exponent other than 0.5, 1 and 2, the
// functions of functions.cpp, LogSoftmax and the logarithms of sums.
//
// Trust: the file is screened, checked by libonnx and only then compiled; a hostile file is refused with a sentence.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace takt::onnx_engine {

struct TensorInfo {
  std::string name;
  std::vector<std::int64_t> shape;  // row-major, every dimension known and at least 1
};

// A file that the weights were read from, by its name beside the model.
struct ExternalFile {
  std::string location;
  std::uintmax_t bytes = 0;
  std::string sha256;  // of the whole file, hex
};

using OperatorCounts = std::map<std::string, int>;
// metadata_props in the file's order: what the exporter says, unchecked.
using Metadata = std::vector<std::pair<std::string, std::string>>;

struct Program;

class Model {
 public:
  explicit Model(std::unique_ptr<Program> program) noexcept;
  Model(Model&&) noexcept;
  Model& operator=(Model&&) noexcept;
  ~Model();

  std::span<const TensorInfo> inputs() const noexcept;
  std::span<const TensorInfo> outputs() const noexcept;

  // Where to write input `i` before run(); its size is the product of the shape. run() leaves it as it is.
  std::span<float> input(std::size_t i) noexcept;
  void run() noexcept;
  // Output `i` of the latest run(); unspecified before the first.
  std::span<const float> output(std::size_t i) const noexcept;

  std::int64_t opset() const noexcept;
  const OperatorCounts& operators() const noexcept;
  std::span<const ExternalFile> external_files() const noexcept;
  const Metadata& metadata() const noexcept;
  // The recurrent nodes, described, that forget between runs what they were trained to remember: one element long, and
  // with a start state that no input decides. Such a network runs, and is wrong from its second step on.
  std::span<const std::string> lost_states() const noexcept;
  // Multiply-adds of a run that are products of matrices: convolutions, and factors of several rows. What this engine
  // is slow at: it keeps to one order of rounding, and so to one multiply-add at a time.
  std::uint64_t matrix_work() const noexcept;
  // What one run does, one after the other: operators whose result is not known at load, and copies.
  std::size_t steps() const noexcept;

 private:
  std::unique_ptr<Program> program_;
};

// Why a file was not loaded, and whether that is this engine's limit: an operator, an attribute, a type or a size that
// it does not know. Not beyond it: what is wrong with the file itself, for any engine.
struct Unloaded {
  std::string sentence;
  bool beyond = false;
};
std::expected<Model, Unloaded> try_load(const std::filesystem::path& file);

std::expected<Model, std::string> load(const std::filesystem::path& file);
// The same from memory; `name` stands for the file in error messages.
std::expected<Model, std::string> load(std::span<const std::byte> bytes, std::string_view name);

// Of a file that another engine is to run: an error unless all its weights lie in files that the policy's hash covers
// (config::policy_files).
std::expected<void, std::string> check_external_data(const std::filesystem::path& file);

// Of a file that this engine cannot load: what its recurrent nodes forget between runs, by its graph alone. Each node
// described, as in Model::lost_states(). `unclear`: whether it takes one step or several was not found out.
struct Memory {
  std::vector<std::string> lost, unclear;
};
std::expected<Memory, std::string> read_memory(const std::filesystem::path& file);

// metadata_props alone, of a file that another engine runs.
std::expected<Metadata, std::string> read_metadata(const std::filesystem::path& file);

// What a file declares, of whichever engine: inputs that have no initializer, and outputs. A dimension that it does not
// say counts as 1.
struct DeclaredTensors {
  std::vector<TensorInfo> inputs, outputs;
};
std::expected<DeclaredTensors, std::string> read_tensors(const std::filesystem::path& file);

}  // namespace takt::onnx_engine
