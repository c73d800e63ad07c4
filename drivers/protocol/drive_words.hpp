// SPDX-License-Identifier: Apache-2.0
// The numbers by which a drive says which one it is and what runs in it, as words of 32 bits, and as the text that the
// robot file (drive.identity, drive.firmware) and the drive card have of them. Pure.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <string>

namespace takt::drivers {

struct DriveWords {
  std::array<std::uint32_t, 3> word{};
  std::size_t count = 0;  // of `word`, from the front; 0: nothing
};

// Every expected word was told, in its place. Nothing is expected: true.
constexpr bool agrees(const DriveWords& expected, const DriveWords& told) noexcept {
  if (told.count < expected.count) return false;
  for (std::size_t i = 0; i < expected.count; ++i)
    if (expected.word[i] != told.word[i]) return false;
  return true;
}
// What may be said of a drive that was asked: `told` is nothing while it has not answered.
constexpr bool contradicts(const DriveWords& expected, const std::optional<DriveWords>& told) noexcept {
  return told && !agrees(expected, *told);
}

enum class WordStyle : std::uint8_t {
  decimal,  // one word, "1234"
  version,  // one word, a byte each: 0x010304 is "1.3.4"
  hex,      // "0000009A:00030924"
};
std::string text_of(const DriveWords& words, WordStyle style);

// How a protocol's drives write a number of theirs; hex: with or without the colons.
struct WordForm {
  WordStyle style = WordStyle::decimal;
  std::size_t least = 1, most = 1;  // words
};
// "any" and an empty text: nothing. The error says what the key should look like.
std::expected<DriveWords, std::string> words_of(const std::string& key, const std::string& text, const WordForm& form);

}  // namespace takt::drivers
