// SPDX-License-Identifier: Apache-2.0
// Identity of everything laid out in shared memory or on disk: a magic number, an ABI version, and a hash of one table
// of fields. Both sides compare all three before a byte is believed.
//
// The table stands beside each structure, one line per field in the structure's order:
//
//   template <std::same_as<Example> Of>
//   constexpr auto fields_of(Shared<Of>) {
//     return std::array{
//         TAKT_FIELD(sequence),
//         TAKT_FIELD(mode),
//     };
//   }
//
// layout_of<Example>() hashes name, type, offset and size of each, those of the structures inside, and the words of
// every enum with their values. Sums of sizes are compared: a field without its line, or hidden padding, does not
// compile.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string_view>
#include <type_traits>
#include <utility>

namespace takt {

inline constexpr std::uint64_t kMagic = 0x31'30'54'4B'41'54'0A'0DULL;  // "\r\nTAKT01", little-endian
inline constexpr std::uint32_t kAbiVersion = 2;

// FNV-1a, 64 bits. Constant expression; equal on every compiler.
class LayoutHash {
 public:
  constexpr LayoutHash& mix(std::uint64_t number) {
    for (int byte = 0; byte < 8; ++byte) add((number >> (8 * byte)) & 0xFF);
    return *this;
  }
  constexpr LayoutHash& mix(std::string_view word) {
    for (const char letter : word) add(static_cast<unsigned char>(letter));
    return mix(word.size());
  }
  [[nodiscard]] constexpr std::uint64_t value() const { return hash_; }

 private:
  constexpr void add(std::uint64_t byte) {
    hash_ ^= byte;
    hash_ *= 0x0000'0100'0000'01B3ULL;
  }
  std::uint64_t hash_ = 0xCBF2'9CE4'8422'2325ULL;
};

// Of pairs of numbers: shapes that are no structure.
struct NumberPair {
  std::size_t first;
  std::size_t second;
};
constexpr std::uint64_t layout_hash(std::initializer_list<NumberPair> pairs) {
  LayoutHash hash;
  for (const NumberPair& pair : pairs) hash.mix(pair.first).mix(pair.second);
  return hash.value();
}

struct Field {
  std::string_view name;
  std::size_t offset;
  std::size_t size;
  std::uint64_t type;     // layout_of()
  std::uint64_t meaning;  // of a number that is a value or mask of an enum: that enum's layout_of(); else 0
};

// Names the structure that a table is of.
template <class Structure>
struct Shared {};

// True when the fields follow one another without a gap from byte 0 to the end.
template <std::size_t count>
constexpr bool is_gapless(const std::array<Field, count>& fields, std::size_t total) {
  std::size_t next = 0;
  for (const Field& field : fields) {
    if (field.offset != next) return false;
    next += field.size;
  }
  return next == total;
}

namespace spelled {

// What the compiler says after `what`, up to one of `ends`.
constexpr std::string_view after(std::string_view said, std::string_view what, std::string_view ends) {
  said.remove_prefix(said.find(what) + what.size());
  return said.substr(0, said.find_first_of(ends));
}

// "takt::FallbackRecord".
template <class Type>
constexpr std::string_view type() {
  return after(__PRETTY_FUNCTION__, "Type = ", ";]");
}

// "takt::Mode::standby, takt::Mode::arming, (takt::Mode)2": a value without a word is a cast.
template <class Enum, Enum... values>
constexpr std::string_view list() {
  const std::string_view list = after(__PRETTY_FUNCTION__, "values = ", ";]");
  return list.substr(1, list.size() - 2);
}

// Bits beyond the type are 0 again.
template <class Enum>
constexpr Enum mask_of(unsigned bit) {
  return static_cast<Enum>(bit < 8 * sizeof(Enum) ? 1U << bit : 0U);
}

// Of the values from 0, and of the higher bits of a mask.
template <class Enum, std::size_t... value>
constexpr std::string_view words(std::index_sequence<value...>) {
  return list<Enum, static_cast<Enum>(value)..., mask_of<Enum>(5), mask_of<Enum>(6), mask_of<Enum>(7), mask_of<Enum>(8),
              mask_of<Enum>(9), mask_of<Enum>(10), mask_of<Enum>(11), mask_of<Enum>(12)>();
}

}  // namespace spelled

// Each word of an enum with its value, where values lie below `values` or are bits below 1 << 13; 0: the value that
// `values` ends with has a word, too.
template <class Enum, std::size_t values>
constexpr std::uint64_t layout_of_words() {
  LayoutHash hash;
  hash.mix(spelled::type<Enum>()).mix(sizeof(Enum));
  const std::string_view words = spelled::words<Enum>(std::make_index_sequence<values>{});
  std::size_t value = 0, begin = 0;
  bool is_word = true;
  for (std::size_t at = 0; at <= words.size(); ++at) {
    const char letter = at < words.size() ? words[at] : ',';
    if (letter == ':' || letter == ' ') begin = at + 1;
    if (letter == '(') is_word = false;
    if (letter != ',') continue;
    if (is_word)
      hash.mix(value < values ? value : std::size_t{1} << (value - values + 5)).mix(words.substr(begin, at - begin));
    if (is_word && value == values - 1) return 0;
    is_word = true;
    ++value;
  }
  return hash.value();
}

template <class Enum>
constexpr std::uint64_t layout_of_enum() {
  constexpr std::uint64_t few = layout_of_words<Enum, 16>();
  if constexpr (few != 0) {
    return few;
  } else {
    return layout_of_words<Enum, 66>();
  }
}

template <class Type>
constexpr std::uint64_t layout_of();

// Of a structure: its fields_of().
template <class Structure>
constexpr std::uint64_t layout_of_fields() {
  static_assert(std::is_standard_layout_v<Structure> && std::is_trivially_copyable_v<Structure>);
  constexpr auto fields = fields_of(Shared<Structure>{});
  static_assert(is_gapless(fields, sizeof(Structure)),
                "a field has no line in fields_of(), lines stand in another order than fields, or padding is hidden");
  LayoutHash hash;
  hash.mix(spelled::type<Structure>()).mix(sizeof(Structure));
  for (const Field& field : fields)
    hash.mix(field.name).mix(field.offset).mix(field.size).mix(field.type).mix(field.meaning);
  return hash.value();
}

template <class Type>
struct ElementsOf {
  static constexpr bool kAreSeveral = false;
};
template <class Element, std::size_t count>
struct ElementsOf<Element[count]> {
  static constexpr bool kAreSeveral = true;
  static constexpr std::uint64_t layout() { return LayoutHash().mix(count).mix(layout_of<Element>()).value(); }
};
template <class Element, std::size_t count>
struct ElementsOf<std::array<Element, count>> : ElementsOf<Element[count]> {};

template <class Type>
constexpr std::uint64_t computed_layout() {
  if constexpr (ElementsOf<Type>::kAreSeveral) {
    return ElementsOf<Type>::layout();
  } else if constexpr (std::is_enum_v<Type>) {
    return layout_of_enum<Type>();
  } else if constexpr (std::is_arithmetic_v<Type>) {
    constexpr std::string_view kind = std::is_floating_point_v<Type> ? "float"
                                      : std::is_same_v<Type, char>   ? "char"
                                      : std::is_signed_v<Type>       ? "signed"
                                                                     : "unsigned";
    return LayoutHash().mix(kind).mix(sizeof(Type)).value();
  } else {
    return layout_of_fields<Type>();
  }
}

// Computed once.
template <class Type>
inline constexpr std::uint64_t kLayoutOf = computed_layout<Type>();

template <class Type>
constexpr std::uint64_t layout_of() {
  static_assert(kLayoutOf<Type> != 0, "an enum has more values than are looked at");
  return kLayoutOf<Type>;
}

template <class Type>
constexpr Field field_of(std::string_view name, std::size_t offset, std::uint64_t meaning = 0) {
  return {name, offset, sizeof(Type), layout_of<Type>(), meaning};
}

// A line of a table. The second form: of a number that is a value of an enum, or a mask of its bits.
#define TAKT_FIELD(member) ::takt::field_of<decltype(Of::member)>(#member, offsetof(Of, member))
#define TAKT_FIELD_OF(Enum, member) \
  ::takt::field_of<decltype(Of::member)>(#member, offsetof(Of, member), ::takt::layout_of<Enum>())

}  // namespace takt
