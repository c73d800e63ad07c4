// SPDX-License-Identifier: Apache-2.0
// ONNX Runtime: an engine for networks beyond small actors (onnx_runtime_engine.cpp), and a second opinion on what the
// built-in one computes and how long it takes. A shared library that the reader has, opened at run time. Takt neither
// links nor ships it.
//
// Sequential execution, on one thread unless more are asked for. Works with any libonnxruntime since 1.0 on Linux,
// x86-64 and aarch64. The library runs in this process and is trusted as much as any other that one loads.
//
// Threads: one thread at a time per OnnxRuntime and its sessions. Sessions must not outlive it.
#pragma once

#include <cstdint>
#include <expected>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace takt::onnx_runtime {

// A tensor of a model by name; `values` is its storage, as many floats as the shape says, and stays where it is.
// In the model its elements may be of any type of numbers: store() and read() of stored_numbers.hpp, on every run.
struct Tensor {
  std::string name;
  std::vector<std::int64_t> shape;
  std::vector<float> values;
};

// `threads`: of one inference, the caller's included, at least 1. `provider`: what computes: "cpu", "cuda" or
// "tensorrt" (on its first device).
struct SessionOptions {
  int threads = 1;
  std::string provider = "cpu";
};

class Library;

class Session {
 public:
  struct Parts;
  explicit Session(std::unique_ptr<Parts> parts) noexcept;
  Session(Session&&) noexcept;
  ~Session();

  std::span<Tensor> inputs() noexcept;     // write the values before run()
  std::span<Tensor> outputs() noexcept;    // read the values after it
  std::expected<void, std::string> run();  // the error is ONNX Runtime's own sentence

 private:
  std::unique_ptr<Parts> parts_;
};

class OnnxRuntime {
 public:
  // `library`: path of libonnxruntime.so, or a bare name that the dynamic linker finds. The error is one line; it says
  // so where the library has no such provider.
  static std::expected<OnnxRuntime, std::string> open(const std::filesystem::path& library,
                                                      const SessionOptions& options = {});
  OnnxRuntime(OnnxRuntime&&) noexcept;
  ~OnnxRuntime();

  std::string version() const;
  // Every tensor that the model declares; a batch dimension becomes 1, no other one may be open.
  std::expected<Session, std::string> load(const std::filesystem::path& model) const;
  // Tensors as the model declares them, by name, with fixed shapes.
  std::expected<Session, std::string> load(const std::filesystem::path& model, std::vector<Tensor> inputs,
                                           std::vector<Tensor> outputs) const;

 private:
  // `said`: inputs and outputs; nothing: every one that the model declares.
  std::expected<Session, std::string> load_session(
      const std::filesystem::path& model,
      std::optional<std::pair<std::vector<Tensor>, std::vector<Tensor>>> said) const;
  explicit OnnxRuntime(std::shared_ptr<Library> library);
  std::shared_ptr<Library> library_;
};

}  // namespace takt::onnx_runtime
