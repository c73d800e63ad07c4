// SPDX-License-Identifier: Apache-2.0
// Identities: of a configuration, a policy file, a list of joints.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <string_view>
#include <vector>

namespace takt::config {

// The number spelt by the first 16 hex digits of a SHA-256: its first 8 bytes, big-endian.
std::uint64_t leading_64_bits(std::string_view sha256_hex);

// What a policy consists of, all of which policy_hash() covers: the file itself and, where they are there, the weights
// that exporters write beside it as FILE.data or FILE_data. Of a LEAPP bundle's YAML also the networks and the start
// values that it names.
std::vector<std::string> policy_files(const std::string& path);
// Of one file its SHA-256; of several the SHA-256 of what `sha256sum` prints of them in that order, names without
// folders: bytes that go from one file to the next change it. 64 hexadecimal digits; policy_hash() is its beginning.
std::expected<std::string, std::string> policy_sha256(const std::string& path);

}  // namespace takt::config
