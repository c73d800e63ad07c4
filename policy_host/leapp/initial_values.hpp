// SPDX-License-Identifier: Apache-2.0
// A safetensors file as LEAPP writes it beside a bundle: the first values of the feedback inputs, by the port they
// start ("node/input"). Only float32 is read, at most 64 MiB, and never more values than the file has bytes for.
// Errors: one line, file, what is wrong. Thread rule: set-up only.
//
// Format: u64 LE length of a JSON map {name: {dtype, shape, data_offsets: [begin, end]}}, that map, the values.
#pragma once

#include <cstdint>
#include <expected>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace takt::policy_host {

struct InitialValue {
  std::vector<std::int64_t> shape;
  std::vector<float> values;
};

std::expected<std::map<std::string, InitialValue>, std::string> read_initial_values(const std::filesystem::path& file);

}  // namespace takt::policy_host
