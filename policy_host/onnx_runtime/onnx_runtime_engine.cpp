// SPDX-License-Identifier: Apache-2.0
// ONNX Runtime as a plugin (takt/engine.h): for what the built-in engine refuses, or runs slower. It opens the library
// of policy.engine.library when it is opened itself, and links none.
#include <fmt/format.h>

#include <exception>
#include <memory>
#include <optional>
#include <utility>

#include "policy_host/engines/tensor_list.hpp"
#include "policy_host/onnx_runtime/onnx_runtime.hpp"

namespace takt::onnx_runtime {
namespace {

constexpr const char* kUsualName = "libonnxruntime.so.1";

struct Network : takt_engine_network {
  OnnxRuntime runtime;  // outlives the session
  Session session;
  std::string about;
  std::vector<takt_engine_tensor> listed_inputs, listed_outputs;

  Network(OnnxRuntime opened, Session loaded, std::string text)
      : takt_engine_network{},
        runtime(std::move(opened)),
        session(std::move(loaded)),
        about(std::move(text)),
        listed_inputs(list(session.inputs())),
        listed_outputs(list(session.outputs())) {
    size = sizeof(takt_engine_network);
    description = about.c_str();
    inputs = listed_inputs.data();
    input_count = listed_inputs.size();
    outputs = listed_outputs.data();
    output_count = listed_outputs.size();
  }

  static std::vector<takt_engine_tensor> list(std::span<Tensor> tensors) {
    std::vector<takt_engine_tensor> list;
    for (Tensor& tensor : tensors) list.push_back(engines::listed(tensor.name, tensor.shape, tensor.values.data()));
    return list;
  }
};

std::expected<std::unique_ptr<Network>, std::string> open_network(const takt_engine_setup& setup) {
  const bool named = *setup.library != '\0';
  auto runtime = OnnxRuntime::open(named ? setup.library : kUsualName,
                                   {.threads = static_cast<int>(setup.threads), .provider = setup.provider});
  if (!runtime)
    return std::unexpected(runtime.error() + (named ? ""
                                                    : "; or say where ONNX Runtime's library is: "
                                                      "policy.engine.library"));
  auto session = runtime->load(setup.file);
  if (!session) return std::unexpected(fmt::format("{}: {}", setup.file, session.error()));
  for (const std::span<Tensor> tensors : {session->inputs(), session->outputs()})
    for (const Tensor& tensor : tensors)
      if (tensor.shape.size() > TAKT_ENGINE_MOST_DIMENSIONS)
        return std::unexpected(fmt::format("{}: tensor {} has more than {} dimensions", setup.file, tensor.name,
                                           TAKT_ENGINE_MOST_DIMENSIONS));
  if (const auto ran = session->run(); !ran) return std::unexpected(fmt::format("{}: {}", setup.file, ran.error()));
  const std::string about = fmt::format("ONNX Runtime {}, {}, {} thread{}", runtime->version(), setup.provider,
                                        setup.threads, setup.threads == 1 ? "" : "s");
  return std::make_unique<Network>(*std::move(runtime), *std::move(session), about);
}

takt_engine_network* open(const takt_engine_setup* setup, char* error, std::size_t error_size) {
  try {
    auto network = open_network(*setup);
    if (network) return network->release();
    engines::say(network.error(), error, error_size);
  } catch (const std::exception& thrown) {
    engines::say(thrown.what(), error, error_size);
  }
  return nullptr;
}

int infer(takt_engine_network* network, char* error, std::size_t error_size) {
  try {
    const auto ran = static_cast<Network*>(network)->session.run();
    if (ran) return 0;
    engines::say(ran.error(), error, error_size);
  } catch (const std::exception& thrown) {
    engines::say(thrown.what(), error, error_size);
  }
  return 1;
}

void reset(takt_engine_network* /*network*/) {}

void close(takt_engine_network* network) {
  delete static_cast<Network*>(network);  // NOLINT(cppcoreguidelines-owning-memory): made by open()
}

constexpr takt_engine_table kEngine{TAKT_ENGINE_ABI, sizeof(takt_engine_table), open, infer, reset, close};

}  // namespace
}  // namespace takt::onnx_runtime

const takt_engine_table* takt_engine() {
  return &takt::onnx_runtime::kEngine;
}
