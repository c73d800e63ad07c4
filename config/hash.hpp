// Identities: of a configuration, a policy file, a list of joints.
#pragma once

#include <cstdint>
#include <string_view>

namespace takt::config {

// The number spelt by the first 16 hex digits of a SHA-256: its first 8 bytes, big-endian.
std::uint64_t leading_64_bits(std::string_view sha256_hex);

}  // namespace takt::config
