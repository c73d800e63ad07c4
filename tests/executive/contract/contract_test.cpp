// SPDX-License-Identifier: Apache-2.0
// Goal: the words that processes share mean the same on both sides. Method: walk every enum's names, pack and index a
// chunk by hand, and change one field to see the layout hash move.
#include <gtest/gtest.h>

#include <set>
#include <string_view>

#include "executive/contract/contract_layout.hpp"
#include "executive/contract/intervention.hpp"

namespace takt {
namespace {

template <class Enum>
void expect_distinct_names(std::size_t count) {
  std::set<std::string_view> seen;
  for (std::size_t i = 0; i < count; ++i) {
    const std::string_view text = name(static_cast<Enum>(i));
    EXPECT_FALSE(text.empty()) << "value " << i;
    EXPECT_TRUE(seen.insert(text).second) << text << " is used twice";
  }
  EXPECT_EQ(name(static_cast<Enum>(count)), "invalid");
}

TEST(Names, EveryValueHasOneOfItsOwn) {
  expect_distinct_names<Mode>(kModeCount);
  expect_distinct_names<Cause>(kCauseCount);
  expect_distinct_names<Arrival>(kArrivalCount);
  expect_distinct_names<Freshness>(kFreshnessCount);
  expect_distinct_names<OverrunCause>(kOverrunCauseCount);
  expect_distinct_names<Role>(kRoleCount);
  EXPECT_EQ(name(Cause::internal_error), "internal_error");
  EXPECT_EQ(name(Arrival::out_of_range), "out_of_range");
}

TEST(CommandChunk, ValuesArePackedStepThenFieldThenJoint) {
  CommandHeader header;
  header.step_count = 3;
  header.joint_count = 4;
  header.fields = static_cast<std::uint8_t>(CommandField::q) | static_cast<std::uint8_t>(CommandField::kd);
  EXPECT_EQ(value_index(header, CommandField::q, 0, 0), 0U);
  EXPECT_EQ(value_index(header, CommandField::kd, 0, 0), 4U);
  EXPECT_EQ(value_index(header, CommandField::q, 1, 2), 10U);
  EXPECT_EQ(value_index(header, CommandField::kd, 2, 3), 23U);
}

TEST(CommandChunk, UsedBytesGrowWithWhatIsUsedOnly) {
  CommandChunk chunk;
  chunk.header.step_count = 16;
  chunk.header.joint_count = 6;
  chunk.header.fields = static_cast<std::uint8_t>(CommandField::q);
  EXPECT_EQ(chunk.used_bytes(), sizeof(CommandHeader) + 4U * 16U * 6U);
}

enum class Colour : std::uint8_t { red, green };
enum class OtherColour : std::uint8_t { red, blue };

constexpr Field a_field(std::string_view name, std::size_t offset, std::size_t size) {
  return {name, offset, size, 0, 0};
}

TEST(LayoutHash, SeesAHole) {
  EXPECT_TRUE(is_gapless(std::array{a_field("a", 0, 8), a_field("b", 8, 4)}, 12));
  EXPECT_FALSE(is_gapless(std::array{a_field("a", 0, 8), a_field("b", 12, 4)}, 16));
  EXPECT_FALSE(is_gapless(std::array{a_field("a", 0, 8), a_field("b", 8, 4)}, 16));
}

// Words that name() says are those of the enum: what a build writes into files is what its layout vouches for.
template <class Enum>
void expect_words(std::size_t count) {
  const std::string_view words = spelled::words<Enum>(std::make_index_sequence<66>{});
  std::size_t begin = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t end = words.find(',', begin);
    const std::string_view word = words.substr(begin, end - begin);
    EXPECT_EQ(word.substr(word.rfind(':') + 1), name(static_cast<Enum>(i)));
    begin = end + 2;
  }
  EXPECT_EQ(words[begin], '(') << "a value beyond the count has a word";
}

TEST(LayoutHash, WordsAreThoseThatFilesSpell) {
  expect_words<Mode>(kModeCount);
  expect_words<Cause>(kCauseCount);
  expect_words<Arrival>(kArrivalCount);
  expect_words<Freshness>(kFreshnessCount);
  expect_words<OverrunCause>(kOverrunCauseCount);
  expect_words<Player>(kPlayerCount);
  expect_words<PolicyChange>(kPolicyChangeCount);
  expect_words<ImuVerdict>(kImuVerdictCount);
}

TEST(LayoutHash, TellsEnumsTypesAndLengthsApart) {
  const std::set<std::uint64_t> layouts{
      layout_of<Colour>(),        layout_of<OtherColour>(), layout_of<std::uint8_t>(),  layout_of<std::int8_t>(),
      layout_of<std::uint16_t>(), layout_of<float>(),       layout_of<std::uint32_t>(), layout_of<float[2]>(),
      layout_of<float[3]>(),      layout_of<Positions>(),   layout_of<Velocities>()};
  EXPECT_EQ(layouts.size(), 11U);
  EXPECT_NE(contract_layout(), 0U);
}

TEST(AgeParts, AddUpExactly) {
  const AgeParts parts{{1}, {20}, {300}, {4000}, {50000}};
  EXPECT_EQ(parts.total(), Duration{54321});
}

}  // namespace
}  // namespace takt
