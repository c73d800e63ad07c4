// SPDX-License-Identifier: Apache-2.0
// Goal: what a robot file says of a drive's identity and firmware is read as it is written on the drive card, and a
// number that is none is refused with a sentence that says what is wanted.
// Method: texts and words side by side, there and back; texts that are wrong by one place.
#include "drivers/protocol/drive_words.hpp"

#include <gtest/gtest.h>

namespace takt::drivers {
namespace {

struct Row {
  const char* text;
  WordForm form;
  DriveWords words;
};

TEST(DriveWords, TextThereAndBack) {
  const std::vector<Row> rows{
      {"70123", {WordStyle::decimal}, {{70123}, 1}},
      {"4294967295", {WordStyle::decimal}, {{0xFFFF'FFFF}, 1}},
      {"0.6.10", {WordStyle::version}, {{0x00'06'0A}, 1}},
      {"1.3.4", {WordStyle::version}, {{0x01'03'04}, 1}},
      {"00010003", {WordStyle::hex}, {{0x0001'0003}, 1}},
      {"0000009A:00030924:DEADBEEF", {WordStyle::hex, 2, 3}, {{0x9A, 0x3'0924, 0xDEAD'BEEF}, 3}},
  };
  for (const Row& row : rows) {
    const auto words = words_of("identity", row.text, row.form);
    ASSERT_TRUE(words) << words.error();
    EXPECT_EQ(words->count, row.words.count) << row.text;
    EXPECT_EQ(words->word, row.words.word) << row.text;
    EXPECT_EQ(text_of(*words, row.form.style), row.text);
  }
  EXPECT_EQ(words_of("identity", "deadbeef00000001", {WordStyle::hex, 2, 2})->word[0], 0xDEAD'BEEF)
      << "colons are optional";
}

TEST(DriveWords, AnyIsNothing) {
  for (const char* const text : {"any", ""}) {
    const auto words = words_of("identity", text, {WordStyle::decimal});
    ASSERT_TRUE(words);
    EXPECT_EQ(words->count, 0U);
    EXPECT_TRUE(agrees(*words, DriveWords{}));
  }
}

TEST(DriveWords, WhatIsNoNumberIsRefused) {
  const std::vector<std::pair<const char*, WordForm>> wrong{
      {"12a", {WordStyle::decimal}},        {"-1", {WordStyle::decimal}},
      {"4294967296", {WordStyle::decimal}}, {"1.3", {WordStyle::version}},
      {"1.3.4.5", {WordStyle::version}},    {"1.3.256", {WordStyle::version}},
      {"1..4", {WordStyle::version}},       {"0001000", {WordStyle::hex}},
      {"0001000G", {WordStyle::hex}},       {"00010003:00010003", {WordStyle::hex}},
      {"0000009A", {WordStyle::hex, 2, 3}},
  };
  for (const auto& [text, form] : wrong) {
    const auto words = words_of("firmware", text, form);
    ASSERT_FALSE(words) << text;
    EXPECT_TRUE(words.error().starts_with("firmware \"" + std::string(text) + "\" is not ")) << words.error();
  }
}

TEST(DriveWords, EveryExpectedWordCounts) {
  const DriveWords expected{{1, 2}, 2};
  EXPECT_TRUE(agrees(expected, {{1, 2, 3}, 3})) << "the third is nobody's business";
  EXPECT_FALSE(agrees(expected, {{1, 3, 3}, 3}));
  EXPECT_FALSE(agrees(expected, {{1, 2}, 1})) << "too little was told";
  EXPECT_FALSE(contradicts(expected, std::nullopt)) << "nothing was told yet";
  EXPECT_TRUE(contradicts(expected, DriveWords{{2, 2}, 2}));
}

}  // namespace
}  // namespace takt::drivers
