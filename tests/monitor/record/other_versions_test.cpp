// SPDX-License-Identifier: Apache-2.0
// Goal: a run that another version recorded tells exactly what it held, or is refused in one sentence that names both
// versions; never "0 ticks". Method: a recorded run written again as other versions would have described it: fields in
// another order, fields that are gone and new, words with other numbers, other types; and a run of an earlier version.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <filesystem>
#include <map>

#include "evidence/review/replay.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/mcap_writer.hpp"
#include "monitor/record/message_schema.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/files.hpp"
#include "tests/support/replaced.hpp"
#include "tests/support/shared_files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

using testing::HasSubstr;

RunVisitor of_ticks(std::function<void(const RecordedTick&)> visit) {
  RunVisitor visitor{};
  visitor.tick = std::move(visit);
  return visitor;
}

using test::replaced;

std::string without(std::string text, std::string_view field) {
  const std::size_t gone = text.find(fmt::format("\n{}", field)) + 1;
  EXPECT_NE(gone, 0U) << field;
  return text.erase(gone, text.find('\n', gone) + 1 - gone);
}

// As another version would describe a tick: its first two fields change places, one is gone, one is unknown here.
std::string other_description() {
  std::string text = replaced(tick_schema(), "\nint64 now ", "\nint64 moon ");
  text = replaced(text, "\nuint64 tick ", "\nint64 now\nuint32 weather\nuint64 tick ");
  return without(text, "uint8[] behind");
}

// Every cause but none has the number of the next one.
std::string with_moved_causes(std::string text) {
  for (std::size_t cause = kCauseCount; cause-- > 1;) {
    std::string word(name(static_cast<Cause>(cause)));
    std::ranges::transform(word, word.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    text = replaced(text, fmt::format("\nuint8 CAUSE_{}={}\n", word, cause),
                    fmt::format("\nuint8 CAUSE_{}={}\n", word, cause + 1));
  }
  return text;
}

class OtherVersions : public test::TemporaryFolder {
 protected:
  OtherVersions() : run_(record_demo(path("run"))) {}

  // The run with its ticks described by `description`; `alter` before a tick is laid out as that says.
  [[nodiscard]] RecordedRun described(const std::string& description, bool is_garbage = false,
                                      const std::function<void(TickRecord&)>& alter = {}) const {
    const RunFolder folder = RunFolder::create(path("other")).value();
    for (const char* file : {"config.yaml", "manifest.json"})
      std::filesystem::copy_file(run_.folder.path() + "/" + file, folder.path() + "/" + file);
    auto topics = run_topics();
    topics[static_cast<std::size_t>(Topic::tick) - 1].schema = description;
    auto writer = McapWriter::create(folder.ticks(), 1U << 30U, topics, {}).value();
    auto relayout = Relayout::make(message_schema_of(tick_schema()).value(), message_schema_of(description).value());
    CdrWriter message;
    RunVisitor visitor = of_ticks([&](const RecordedTick& tick) {
      TickRecord record = tick.record;
      if (alter) alter(record);
      encode_tick(record, tick.crc, message);
      // Of one whose description is all that is other, the same bytes.
      const auto bytes = relayout ? (*relayout)(message.bytes()) : std::span(message.bytes());
      writer.write(static_cast<std::uint16_t>(Topic::tick), 1, is_garbage ? bytes.first(20) : bytes);
    });
    visitor.command = [&](const RecordedCommand& command) {
      encode_command(command, message);
      writer.write(static_cast<std::uint16_t>(Topic::command), 1, message.bytes());
    };
    (void)scan_run(run_, visitor);
    writer.finish();
    return open_run(folder.path()).value();
  }

  static std::map<std::uint64_t, TickRecord> ticks_of(const RecordedRun& run) {
    std::map<std::uint64_t, TickRecord> ticks;
    const auto scan = scan_run(run, of_ticks([&](const RecordedTick& tick) {
                                 ticks[tick.record.header.tick] = tick.record;
                                 EXPECT_EQ(tick.crc, crc_of(tick.record)) << "told as altered";
                               }));
    EXPECT_TRUE(scan) << scan.error();
    return ticks;
  }

  static std::string refusal_of(const RecordedRun& run) {
    const auto scan = scan_run(run, of_ticks([](const RecordedTick&) {}));
    return scan ? "read" : scan.error();
  }

  RecordedRun run_;
};

TEST_F(OtherVersions, FieldsGoByTheirNames) {
  const RecordedRun other = described(other_description());
  const auto expected = ticks_of(run_), found = ticks_of(other);
  ASSERT_EQ(found.size(), kDemoTicks);
  for (const auto& [tick, record] : found)
    ASSERT_EQ(std::memcmp(&record, &expected.at(tick), record.used_bytes()), 0) << tick;
  const auto replayed = evidence::replay(other, 1);
  ASSERT_FALSE(replayed);
  EXPECT_THAT(replayed.error(),
              HasSubstr("cannot be replayed bit for bit: its ticks hold `weather`, which this version "
                        "does not know (made by takt "));
}

// Goal: a run of a version that recorded less replays bit for bit in what it has; one that lacks an input is refused.
// Method: outputs of the tick and of joints are left out of the description, one of them altered first; then an input.
TEST_F(OtherVersions, WhatItRecordedReplays) {
  const std::string description = without(without(tick_schema(), "int64 age "), "float32[] tau_total");
  const auto replayed =
      evidence::replay(described(description, false, [](TickRecord& record) { record.joints[0].tau_total += 1; }), 1);
  ASSERT_TRUE(replayed) << replayed.error();
  EXPECT_EQ(replayed->identical, kDemoTicks);
  EXPECT_EQ(replayed->mismatches, 0U);
  EXPECT_FALSE(replayed->is_whole()) << "what is not compared may be anything";
  EXPECT_EQ(replayed->not_compared, (std::vector<std::string>{"age", "tau_total"}));
}

TEST_F(OtherVersions, WhatItRecordedIsStillCompared) {
  const auto alter = [](TickRecord& record) { record.joints[1].q_reference += record.header.tick == 900 ? 1 : 0; };
  const auto replayed = evidence::replay(described(without(tick_schema(), "int64 age "), false, alter), 1);
  ASSERT_TRUE(replayed) << replayed.error();
  ASSERT_TRUE(replayed->first);
  EXPECT_EQ(replayed->first->tick, 900U);
  EXPECT_EQ(replayed->first->field, "q_reference");
}

TEST_F(OtherVersions, OneThatLacksAnInputIsNotReplayed) {
  const auto replayed = evidence::replay(described(without(tick_schema(), "int64 lateness ")), 1);
  ASSERT_FALSE(replayed);
  EXPECT_THAT(replayed.error(), HasSubstr("its ticks lack `lateness`, which decides (made by takt "));
}

// Goal: reserved bytes keep no run from being read. Method: fewer of them than this version has.
TEST(MessageSchema, ReservedBytesMayBecomeFewer) {
  const auto relayout = Relayout::make(message_schema_of("uint8 a\nuint8[6] reserved\n").value(),
                                       message_schema_of("uint8 a\nuint8[7] reserved\n").value());
  EXPECT_TRUE(relayout) << relayout.error();
}

// Before there was a fallback policy no tick said who plays.
TEST_F(OtherVersions, WhereOnlyThePolicyPlaysItIsThePolicy) {
  std::string text = tick_schema();
  const std::size_t gone = text.find("\nuint8 player ");
  const auto found = ticks_of(described(text.erase(gone, text.find('\n', gone + 1) - gone)));
  std::size_t played = 0;
  for (const auto& [tick, record] : ticks_of(run_))
    if (record.header.mode == Mode::tracking) {
      ASSERT_EQ(found.at(tick).header.player, record.header.player) << tick;
      ++played;
    }
  EXPECT_GT(played, 1'000U);
}

TEST_F(OtherVersions, WordsGoByTheirNames) {
  const RecordedRun other = described(with_moved_causes(tick_schema()), false, [](TickRecord& record) {
    auto& cause = record.header.cause;
    if (cause != Cause::none) cause = static_cast<Cause>(static_cast<int>(cause) + 1);
    record.header.causes_active <<= 1U;
  });
  const auto expected = ticks_of(run_), found = ticks_of(other);
  ASSERT_EQ(found.size(), kDemoTicks);
  std::size_t stops = 0;
  for (const auto& [tick, record] : found) {
    ASSERT_EQ(record.header.cause, expected.at(tick).header.cause) << tick;
    ASSERT_EQ(record.header.causes_active, expected.at(tick).header.causes_active) << tick;
    stops += record.header.cause != Cause::none ? 1U : 0U;
  }
  EXPECT_GT(stops, 2U);
}

TEST_F(OtherVersions, AWordThatIsNotKnownIsRefusedWhereItIsSaid) {
  const std::string text = replaced(tick_schema(), "CAUSE_COMMAND_LOST=", "CAUSE_BAD_WEATHER=");
  EXPECT_THAT(refusal_of(described(text)), HasSubstr("`CAUSE_BAD_WEATHER`"));
}

TEST_F(OtherVersions, AnotherTypeIsRefusedWithBothVersions) {
  const std::string refusal =
      refusal_of(described(replaced(tick_schema(), "float32[] q_estimate", "float64[] q_estimate")));
  EXPECT_THAT(refusal,
              HasSubstr("/takt/tick has `q_estimate` as float64[], this version reads float32[] (made by takt "));
  EXPECT_THAT(refusal, HasSubstr("; this is takt "));
}

TEST_F(OtherVersions, ANarrowerNumberIsTheSameNumber) {
  const auto narrow = message_schema_of("uint64 tick\nuint8[] faults\nuint8 mode\n").value();
  const auto wide = message_schema_of("uint64 tick\nuint16[] faults\nuint8 mode\n").value();
  CdrWriter message;
  message.put(std::uint64_t{7});
  message.put_octets(std::vector<std::byte>(3, std::byte{200}));
  message.put(std::uint8_t{5});
  auto relayout = Relayout::make(narrow, wide).value();
  CdrReader reader(relayout(message.bytes()));
  EXPECT_EQ(reader.get<std::uint64_t>(), 7U);
  ASSERT_EQ(reader.get_count(9), 3U);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(reader.get<std::uint16_t>(), 200);
  EXPECT_EQ(reader.get<std::uint8_t>(), 5);
  EXPECT_TRUE(reader.ok());
  EXPECT_FALSE(Relayout::make(wide, narrow)) << "it may not fit";
  for (std::size_t length = 0; length < message.bytes().size(); ++length)
    EXPECT_TRUE(relayout(std::span(message.bytes()).first(length)).empty()) << length;
}

TEST_F(OtherVersions, ADescriptionOfAStrangerIsRefused) {
  EXPECT_FALSE(message_schema_of(std::string((256 << 10) + 1, '#')));
  std::string many;
  for (int i = 0; i < 3000; ++i) many += "uint8 f" + std::to_string(i) + "\n";
  EXPECT_FALSE(message_schema_of(many));
  for (const char* const text : {"uint8\n", "uint8[x] a\n", "uint8[ a\n", "uint8[99999999999] a\n"})
    EXPECT_FALSE(message_schema_of(text)) << text;
  const auto ours = message_schema_of(tick_schema()).value();
  EXPECT_THAT(Relayout::make(message_schema_of("").value(), ours).error(), HasSubstr("lacks `tick`"));
  EXPECT_THAT(Relayout::make(message_schema_of("uint64 tick\ngeometry_msgs/Pose pose\n").value(), ours).error(),
              HasSubstr("geometry_msgs/Pose"));
}

// A file that describes a topic anew for each message would cost a description's reading each time.
TEST_F(OtherVersions, ATopicHasOneDescription) {
  const RunFolder folder = RunFolder::create(path("twice")).value();
  for (const char* file : {"config.yaml", "manifest.json"})
    std::filesystem::copy_file(run_.folder.path() + "/" + file, folder.path() + "/" + file);
  auto topics = run_topics();
  topics.push_back(topics[static_cast<std::size_t>(Topic::tick) - 1]);
  topics.back().schema = other_description();
  auto writer = McapWriter::create(folder.ticks(), 1U << 30U, topics, {}).value();
  CdrWriter message;
  (void)scan_run(run_, of_ticks([&](const RecordedTick& tick) {
                   encode_tick(tick.record, tick.crc, message);
                   const bool is_odd = tick.record.header.tick % 2 != 0;
                   writer.write(static_cast<std::uint16_t>(is_odd ? topics.size() : std::size_t{1}), 1,
                                message.bytes());
                 }));
  writer.finish();
  EXPECT_THAT(refusal_of(open_run(folder.path()).value()), HasSubstr("/takt/tick is described twice, and otherwise"));
}

// A schema record with a number that another has, before the file's own.
TEST_F(OtherVersions, ANumberHasOneSchema) {
  std::string bytes = test::text_of(run_.folder.ticks());
  const std::string content("\x01\x00\x01\x00\x00\x00x\x00\x00\x00\x00\x00\x00\x00\x00", 15);
  std::string record("\x03\x0f\x00\x00\x00\x00\x00\x00\x00", 9);
  bytes.insert(8, record + content);
  ASSERT_TRUE(replace_file(run_.folder.ticks(), bytes));
  EXPECT_THAT(refusal_of(run_), HasSubstr("/takt/tick lacks `now`"));
}

TEST_F(OtherVersions, TicksOfWhichNoneCanBeReadAreNoEmptyRun) {
  EXPECT_THAT(refusal_of(described(tick_schema(), true)),
              HasSubstr("has 4000 messages of /takt/tick, and none is a tick"));
}

TEST_F(OtherVersions, AFormatThatIsNotKnownSaysWhoMadeIt) {
  const std::string manifest = read_file(run_.folder.manifest()).value();
  ASSERT_TRUE(replace_file(run_.folder.manifest(), replaced(manifest, "takt.run/2", "takt.run/3")));
  const auto opened = open_run(run_.folder.path());
  ASSERT_FALSE(opened);
  EXPECT_THAT(opened.error(),
              HasSubstr("has the format takt.run/3, and takt.run/1 and takt.run/2 are read: made by takt "));
}

// Of 26 November 2026, version 0.1.0: 13 causes fewer, no IMU, no fallback policy, `control.overrun_limit`.
TEST(EarlierRun, IsReadWhole) {
  const std::string folder = "../shared/field/run_99f7ab0d";
  TAKT_NEEDS_SHARED(folder + "/ticks.mcap");
  const auto run = open_run(folder);
  ASSERT_TRUE(run) << run.error();
  std::uint64_t ticks = 0, last = 0;
  std::map<Mode, std::uint64_t> modes;
  const auto scan = scan_run(*run, of_ticks([&](const RecordedTick& tick) {
    ++ticks;
    last = tick.record.header.tick;
    ++modes[tick.record.header.mode];
    EXPECT_EQ(tick.record.header.joint_count, 6U);
  }));
  ASSERT_TRUE(scan) << scan.error();
  EXPECT_TRUE(scan->is_of_other_layout);
  EXPECT_EQ(scan->undecodable, 0U);
  EXPECT_EQ(ticks, 9118U);
  EXPECT_EQ(last, 9118U);
  EXPECT_GT(modes[Mode::standby] + modes[Mode::tracking], 0U);
}

}  // namespace
}  // namespace takt::monitor
