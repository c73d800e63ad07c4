// SPDX-License-Identifier: Apache-2.0
// The very first look at an untrusted model: what would building its messages cost? A message takes two bytes in a file
// and hundreds in memory, so that a few megabytes of empty nodes want gigabytes of it.
//
// The file's fields are walked over as protobuf writes them, by libonnx's own descriptions, nothing is built; what each
// would take beyond its own bytes in the file is added up, and more than kMostParseBytes is refused. Weights (raw data,
// floats) take what they take in the file, and cost nothing here. Pure; allocates nothing.
#pragma once

#include <cstddef>
#include <span>

namespace google::protobuf {
class Descriptor;
}

namespace takt::onnx_engine {

// Room for half a million messages, five for each of the 100,000 nodes that a model may have.
inline constexpr std::size_t kMostParseBytes = std::size_t{256} << 20U;

// False: not what protobuf writes, or cut short. Throws Refusal for one that takes too much.
bool screen_wire(std::span<const std::byte> bytes, const google::protobuf::Descriptor& message);

}  // namespace takt::onnx_engine
