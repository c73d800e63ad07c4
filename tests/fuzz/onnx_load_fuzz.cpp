// SPDX-License-Identifier: Apache-2.0
// Any bytes as an ONNX model: refused with a sentence, or loaded and run; never a crash.
// Small exported models in the corpus folder help: without any the fuzzer has to find out about protobuf first.
#include <cstddef>
#include <cstdint>
#include <span>

#include "policy_host/onnx_engine/model.hpp"
#include "tests/fuzz/refused_with_a_sentence.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  auto model = takt::onnx_engine::load(std::as_bytes(std::span(data, size)), "fuzz");
  takt::fuzz::judge(model);
  if (model) model->run();
  return 0;
}
