// SPDX-License-Identifier: Apache-2.0
// Files that a bundle's YAML names: beside it, and nowhere else, as for the data of an ONNX file
// (onnx/external_data.hpp). What lies elsewhere the policy's hash does not cover, and a deployment does not copy.
#pragma once

#include <expected>
#include <filesystem>
#include <string>

namespace takt::policy_host {

// Path of `name` in the folder of `bundle`, where `key` of it names it; it need not be there. Refused, one line: a
// path,
// "..", what is there and is no regular file, a link that leaves the folder. Reads nothing.
std::expected<std::filesystem::path, std::string> path_beside(const std::string& bundle, const std::string& key,
                                                              const std::string& name);

}  // namespace takt::policy_host
