// SPDX-License-Identifier: Apache-2.0
// One network behind whichever engine runs it: tensors in, tensors out.
//
// Tensors are row-major float32. Inputs are zero until written, and stay as they are over run(). Thread rule: one
// thread at a time; load at set-up.
#pragma once

#include <expected>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "policy_host/onnx_engine/model.hpp"

namespace takt::policy_host {

class Network {
 public:
  Network() = default;
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;
  virtual ~Network() = default;

  [[nodiscard]] virtual std::span<const onnx_engine::TensorInfo> inputs() const = 0;
  [[nodiscard]] virtual std::span<const onnx_engine::TensorInfo> outputs() const = 0;
  // Recurrent nodes, described, that forget between runs; empty too where the engine does not look into the network.
  [[nodiscard]] virtual std::span<const std::string> lost_states() const { return {}; }
  [[nodiscard]] virtual bool is_built_in() const { return false; }
  // What runs it, for the log: "ONNX Runtime 1.30.0, cpu, 1 thread".
  [[nodiscard]] virtual std::string description() const { return "an engine"; }
  // The engine itself carries something from run to run; forget() is how it was after load.
  [[nodiscard]] virtual bool keeps_state() const { return false; }
  virtual void forget() {}

  virtual std::span<float> input(std::size_t i) = 0;
  virtual std::span<const float> output(std::size_t i) const = 0;
  // Throws std::runtime_error where the engine fails; the built-in one cannot.
  virtual void run() = 0;
};

// Of an engine: reads a policy's file. The error is one line that begins with the file.
using LoadNetwork =
    std::function<std::expected<std::unique_ptr<Network>, std::string>(const std::filesystem::path& file)>;

}  // namespace takt::policy_host
