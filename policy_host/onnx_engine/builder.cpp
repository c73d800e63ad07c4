// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/builder.hpp"

#include <fmt/format.h>

namespace takt::onnx_engine {

namespace {

std::size_t vetted_elements(const std::string& name, const Shape& shape) {
  const std::int64_t count = checked_elements(shape);
  if (count < 0) {
    throw Beyond(fmt::format("tensor '{}' of shape {} is larger than this engine holds ({} MiB, {} dimensions)", name,
                             to_text(shape), max_model_bytes >> 20, max_rank));
  }
  return static_cast<std::size_t>(count);
}

}  // namespace

std::string_view to_text(ElementType type) {
  switch (type) {
    case ElementType::float32:
      return "float32";
    case ElementType::int64:
      return "int64";
    case ElementType::live_int64:
      return "int64 that an input decides";
    case ElementType::boolean:
      return "bool";
  }
  return "invalid";
}

const Value* Builder::find(std::string_view name) const {
  const auto found = values_.find(name);
  return found == values_.end() ? nullptr : &found->second;
}

Value& Builder::define_floats(const std::string& name, const Shape& shape, ElementType type) {
  const std::size_t count = vetted_elements(name, shape);
  if (count == 0) throw Beyond(fmt::format("tensor '{}' of shape {} has no elements", name, to_text(shape)));
  return insert(name, {.type = type, .shape = shape, .floats = allocate(count), .integers = {}});
}

Value& Builder::define_integers(const std::string& name, const Shape& shape, std::vector<std::int64_t> integers) {
  if (vetted_elements(name, shape) != integers.size()) {
    throw Refusal(fmt::format("tensor '{}' of shape {} holds {} integers", name, to_text(shape), integers.size()));
  }
  charge(integers.size() * sizeof(std::int64_t));
  return insert(name, {.type = ElementType::int64, .shape = shape, .constant = true, .integers = std::move(integers)});
}

Value& Builder::define_view(const std::string& name, const Shape& shape, const Value& source) {
  if (vetted_elements(name, shape) != elements(source.shape)) {
    throw Refusal(fmt::format("shape {} cannot be read as {}", to_text(source.shape), to_text(shape)));
  }
  if (source.type == ElementType::int64) return define_integers(name, shape, source.integers);
  Value view = source;
  view.shape = shape;
  return insert(name, std::move(view));
}

float* Builder::allocate(std::size_t floats) {
  charge(floats * sizeof(float));
  program_.buffers.push_back(allocate_floats(floats));
  return program_.buffers.back().get();
}

void Builder::begin_branch() {
  branches_.push_back({std::move(program_.steps), {}});
  program_.steps.clear();
}

std::vector<std::unique_ptr<Step>> Builder::end_branch() {
  Branch branch = std::move(branches_.back());
  branches_.pop_back();
  for (const std::string& name : branch.names) closed_.push_back(values_.extract(name));
  std::vector<std::unique_ptr<Step>> steps = std::move(program_.steps);
  program_.steps = std::move(branch.steps_outside);
  return steps;
}

void Builder::charge(std::size_t bytes) {
  if (bytes > max_model_bytes - bytes_) {
    throw Beyond(fmt::format("its tensors need more than {} MiB", max_model_bytes >> 20));
  }
  bytes_ += bytes;
}

Value& Builder::insert(const std::string& name, Value value) {
  if (name.empty()) {
    unnamed_.push_back(std::make_unique<Value>(std::move(value)));
    return *unnamed_.back();
  }
  const auto [place, is_new] = values_.try_emplace(name, std::move(value));
  if (!is_new) throw Refusal(fmt::format("value '{}' is defined twice", name));
  if (!branches_.empty()) branches_.back().names.push_back(name);
  return place->second;
}

}  // namespace takt::onnx_engine
