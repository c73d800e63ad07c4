// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/drive_words.hpp"

#include <cctype>
#include <charconv>
#include <cstdio>

namespace takt::drivers {
namespace {

// Nothing: not all of it is one number within the bounds.
std::optional<std::uint32_t> number_of(const std::string& text, int base, std::uint32_t most = 0xFFFF'FFFF) {
  std::uint32_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number, base);
  if (error != std::errc{} || end != text.data() + text.size() || number > most) return std::nullopt;
  return number;
}

std::optional<DriveWords> version_of(const std::string& text) {
  DriveWords words{.word = {}, .count = 1};
  std::size_t from = 0;
  for (int part = 0; part < 3; ++part) {
    const std::size_t dot = text.find('.', from);
    if ((dot == std::string::npos) != (part == 2)) return std::nullopt;
    const auto number = number_of(text.substr(from, dot - from), 10, 255);
    if (!number) return std::nullopt;
    words.word[0] = words.word[0] << 8U | *number;
    from = dot + 1;
  }
  return words;
}

std::optional<DriveWords> hex_words_of(const std::string& text, const WordForm& form) {
  constexpr std::size_t kDigits = 8;
  std::string digits;
  for (const char c : text)
    if (c != ':') digits += c;
  DriveWords words{.word = {}, .count = digits.size() / kDigits};
  if (digits.size() % kDigits != 0 || words.count < form.least || words.count > form.most) return std::nullopt;
  for (std::size_t i = 0; i < words.count; ++i) {
    const auto number = number_of(digits.substr(i * kDigits, kDigits), 16);
    if (!number) return std::nullopt;
    words.word[i] = *number;
  }
  return words;
}

std::string wanted(const WordForm& form) {
  switch (form.style) {
    case WordStyle::decimal:
      return "a whole number";
    case WordStyle::version:
      return "a version of three numbers, such as 1.3.4";
    case WordStyle::hex:
      return form.most == 1 ? "8 hexadecimal digits"
             : form.least == form.most
                 ? std::to_string(form.most) + " groups of 8 hexadecimal digits, with a colon between"
                 : std::to_string(form.least) + " or " + std::to_string(form.most) +
                       " groups of 8 hexadecimal digits, with a colon between";
  }
  return {};
}

}  // namespace

std::string text_of(const DriveWords& words, WordStyle style) {
  std::string text;
  std::array<char, 32> digits{};
  for (std::size_t i = 0; i < words.count; ++i) {
    const std::uint32_t word = words.word[i];
    switch (style) {
      case WordStyle::decimal:
        std::snprintf(digits.data(), digits.size(), "%u", word);
        break;
      case WordStyle::version:
        std::snprintf(digits.data(), digits.size(), "%u.%u.%u", word >> 16U, word >> 8U & 0xFFU, word & 0xFFU);
        break;
      case WordStyle::hex:
        std::snprintf(digits.data(), digits.size(), "%08X", word);
        break;
    }
    text += (i == 0 ? "" : ":") + std::string(digits.data());
  }
  return text;
}

std::expected<DriveWords, std::string> words_of(const std::string& key, const std::string& text, const WordForm& form) {
  if (text.empty() || text == "any") return DriveWords{};
  std::optional<DriveWords> words;
  switch (form.style) {
    case WordStyle::decimal:
      if (const auto number = number_of(text, 10)) words = DriveWords{.word = {*number}, .count = 1};
      break;
    case WordStyle::version:
      words = version_of(text);
      break;
    case WordStyle::hex:
      words = hex_words_of(text, form);
      break;
  }
  if (!words)
    return std::unexpected(key + " \"" + text + "\" is not " + wanted(form) + ": write it as the drive card shows it");
  return *words;
}

}  // namespace takt::drivers
