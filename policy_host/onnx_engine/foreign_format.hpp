// SPDX-License-Identifier: Apache-2.0
// What a file that is no ONNX model is, by its first bytes: policies have many formats, and an ending says little.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace takt::onnx_engine {

// "is TorchScript, not ONNX: ...", with what to do; empty: of no format that is known here.
std::string foreign_format(std::span<const std::byte> bytes);

}  // namespace takt::onnx_engine
