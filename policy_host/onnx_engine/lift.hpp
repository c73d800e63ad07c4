// SPDX-License-Identifier: Apache-2.0
// Models of opsets before this engine's own: the graph is rewritten for the oldest opset that the engine takes, by what
// the standard says of both. The file, and with it the policy's hash, stays as it is.
//
// An operator whose definition did not change in between is kept. Of those that did, the changes are written down here:
// second operands that `axis` aligned (Add ... Xor), slopes of PRelu by channel, the shape of Reshape as an attribute,
// defaults of Concat and Selu, and attributes that only said how to compute. Anything else is refused. (libonnx has a
// converter too; Debian 12's aligns an axis other than 0 wrongly, and crashes on graphs that are none.)
#pragma once

#include <cstdint>

namespace onnx {
class ModelProto;
}  // namespace onnx

namespace takt::onnx_engine {

// Precondition: screened (screen_model), batch settled, checked by libonnx for its own opset. Throws Beyond where an
// operator changed otherwise, or was exported for training; Refusal where the file contradicts itself.
void lift(onnx::ModelProto& model, std::int64_t target);

}  // namespace takt::onnx_engine
