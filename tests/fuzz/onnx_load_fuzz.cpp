// SPDX-License-Identifier: Apache-2.0
// Any bytes as an ONNX model: refused with a sentence, or loaded and run; never a crash.
// Small exported models in the corpus folder help: without any the fuzzer has to find out about protobuf first.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "policy_host/onnx/model.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  auto model = takt::onnx_engine::load(std::as_bytes(std::span(data, size)), "fuzz");
  if (!model) {
    if (model.error().empty()) std::abort();
    return 0;
  }
  model->run();
  return 0;
}
