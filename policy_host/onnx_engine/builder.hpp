// SPDX-License-Identifier: Apache-2.0
// Turns the nodes of a screened graph into a Program, one after the other.
//
// Every value has its final shape and address as soon as it exists. Integers are always known at load, which is what
// makes shape arithmetic (Shape, Gather, Concat, Reshape ...) vanish; float work whose sources are all constant runs
// once, here. A refusal is an exception: it can only happen at load, and load() turns it into its error.
#pragma once

#include <concepts>
#include <cstdint>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "policy_host/onnx_engine/program.hpp"
#include "policy_host/onnx_engine/tensor.hpp"

namespace takt::onnx_engine {

// Of a file in which something is wrong.
class Refusal : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};
// Of one in which nothing is found wrong but that it wants more than this engine can do; another one may run it.
class Beyond : public Refusal {
 public:
  using Refusal::Refusal;
};

// Integers known at load; those that an input decides (a step counted by the caller) and truths live as floats, whole
// numbers and 0 or 1, so that not a number passes through them as well.
enum class ElementType : std::uint8_t { float32, int64, live_int64, boolean };
std::string_view to_text(ElementType type);

struct Value {
  ElementType type = ElementType::float32;
  Shape shape;
  bool constant = false;
  float* floats = nullptr;             // all but int64; owned by the Program
  std::vector<std::int64_t> integers;  // int64 only
};

class Builder {
 public:
  Builder(Program& program, std::int64_t opset) : program_(program), opset_(opset) {}

  std::int64_t opset() const { return opset_; }
  const Value* find(std::string_view name) const;

  // New values. A name may be defined once; an output that is not used has an empty name and cannot be found.
  Value& define_floats(const std::string& name, const Shape& shape, ElementType type = ElementType::float32);
  Value& define_integers(const std::string& name, const Shape& shape, std::vector<std::int64_t> integers);
  // The same elements in the same order under another name and shape.
  Value& define_view(const std::string& name, const Shape& shape, const Value& source);

  // Storage the program keeps, for scratch.
  float* allocate(std::size_t floats);
  // What `fill` makes of zeros, here and now, and constant afterwards: packed weights.
  template <std::invocable<float*> Fill>
  const float* constant(std::size_t floats, Fill fill) {
    charge(floats * sizeof(float));
    FloatBuffer made = allocate_floats(floats);
    fill(made.get());
    return program_.constants.emplace_back(share_constant(std::move(made), floats)).get();
  }
  // Counts index tables against the cap of a model.
  void charge(std::size_t bytes);

  // What is defined in between belongs to a branch of the graph: it is not found afterwards, and its work is returned
  // instead of being every run's. Branches may have branches.
  void begin_branch();
  std::vector<std::unique_ptr<Step>> end_branch();

  void count_operator(const std::string& op_type) { ++program_.operators[op_type]; }

  // A recurrent node of one element whose start state no input decides.
  void report_lost_state(std::string node) { program_.lost_states.push_back(std::move(node)); }

  // Multiply-adds of a product whose left factor has several rows.
  void count_matrix_work(std::size_t rows, std::size_t inner, std::size_t columns) {
    if (rows > 1) program_.matrix_work += std::uint64_t{rows} * inner * columns;
  }

  // Work for every run.
  template <std::invocable Work>
  void each_run(Work work) {
    program_.steps.push_back(std::make_unique<WorkStep<Work>>(std::move(work)));
  }
  // Work that fills `result`: done here and now if the sources are constants, else on every run.
  template <std::invocable Work>
  void compute(Value& result, const std::vector<const Value*>& sources, Work work) {
    bool constant = true;
    for (const Value* source : sources) constant = constant && source->constant;
    result.constant = constant;
    if (constant) {
      work();
    } else {
      each_run(std::move(work));
    }
  }

 private:
  using Values = std::map<std::string, Value, std::less<>>;

  template <std::invocable Work>
  class WorkStep final : public Step {
   public:
    explicit WorkStep(Work work) : work_(std::move(work)) {}
    void run() noexcept override { work_(); }

   private:
    Work work_;
  };

  Value& insert(const std::string& name, Value value);
  struct Branch {
    std::vector<std::unique_ptr<Step>> steps_outside;
    std::vector<std::string> names;
  };

  Program& program_;
  std::int64_t opset_;
  std::size_t bytes_ = 0;
  Values values_;
  std::vector<std::unique_ptr<Value>> unnamed_;
  std::vector<Branch> branches_;           // that are open, the innermost last
  std::vector<Values::node_type> closed_;  // values of closed ones, where they were
};

}  // namespace takt::onnx_engine
