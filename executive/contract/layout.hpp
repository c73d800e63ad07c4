// Identity of everything laid out in shared memory or on disk: a magic number, an ABI version, and a hash of the
// field offsets and sizes that a structure declares. Both sides compare all three before a byte is believed.
//
// A structure lists its fields once, beside its definition: kLayoutHash = layout_hash({{offset, size}, ...}).
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>

namespace takt {

inline constexpr std::uint64_t kMagic = 0x31'30'54'4B'41'54'0A'0DULL;  // "\r\nTAKT01", little-endian
inline constexpr std::uint32_t kAbiVersion = 2;

struct Field {
  std::size_t offset;
  std::size_t size;
};

// FNV-1a over (offset, size) pairs. Constant expression; equal layouts give equal hashes on every compiler.
constexpr std::uint64_t layout_hash(std::initializer_list<Field> fields) {
  std::uint64_t hash = 0xCBF2'9CE4'8422'2325ULL;
  const auto mix = [&hash](std::uint64_t value) {
    for (int byte = 0; byte < 8; ++byte) {
      hash ^= (value >> (8 * byte)) & 0xFF;
      hash *= 0x0000'0100'0000'01B3ULL;
    }
  };
  for (const Field& field : fields) {
    mix(field.offset);
    mix(field.size);
  }
  return hash;
}

// One field of `Type`, as layout_hash wants it.
#define TAKT_FIELD(Type, member)                 \
  ::takt::Field {                                \
    offsetof(Type, member), sizeof(Type::member) \
  }

// True when the listed fields follow one another without a gap from byte 0 to the end: no hidden padding.
constexpr bool is_gapless(std::initializer_list<Field> fields, std::size_t total) {
  std::size_t next = 0;
  for (const Field& field : fields) {
    if (field.offset != next) return false;
    next += field.size;
  }
  return next == total;
}

}  // namespace takt
