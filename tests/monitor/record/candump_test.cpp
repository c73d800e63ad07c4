// SPDX-License-Identifier: Apache-2.0
// Goal: our logs are can-utils' logs: every frame we write, we and python-can read back; nothing malformed is accepted.
#include "monitor/record/candump.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>

#include "drivers/bus/can_frame.hpp"

namespace takt::monitor {
namespace {

drivers::CanFrame frame(std::uint32_t id, std::initializer_list<int> bytes) {
  drivers::CanFrame made;
  made.id = id;
  for (const int byte : bytes) made.data[made.length++] = static_cast<std::uint8_t>(byte);
  return made;
}

std::string text_of(const drivers::CanFrame& frame) {
  std::string text;
  append_frame_text(text, frame);
  return text;
}

std::string line_of(const drivers::CanFrame& frame, std::int64_t stamp_ns, FrameDirection direction) {
  std::string line;
  append_candump_line(line, drivers::to_record(frame, MonoTime{stamp_ns}, 0, 0, direction), "can0", 0);
  return line;
}

bool same(const drivers::CanFrame& a, const drivers::CanFrame& b) {
  return a.id == b.id && a.extended == b.extended && a.fd == b.fd && a.bit_rate_switch == b.bit_rate_switch &&
         a.remote == b.remote && a.error == b.error && a.length == b.length && std::ranges::equal(a.data, b.data);
}

// Every kind with the text candump writes for it.
std::vector<std::pair<drivers::CanFrame, std::string>> every_kind() {
  std::vector<std::pair<drivers::CanFrame, std::string>> kinds{
      {frame(0x123, {0xDE, 0xAD, 0xBE, 0xEF}), "123#DEADBEEF"},
      {frame(0x001, {}), "001#"},
      {frame(0x12345, {1}), "00012345#01"},
      {frame(0x123, {0xAA, 0xBB}), "123##1AABB"},
      {frame(0x7FF, {0}), "7FF##000"},
      {frame(0x10, {}), "010#R"},
      {frame(0x10, {}), "010#R4"},
      {frame(0x40, {0, 0, 0, 0, 0, 0, 0, 0}), "20000040#0000000000000000"},
  };
  kinds[2].first.extended = true;
  kinds[3].first.fd = kinds[3].first.bit_rate_switch = true;
  kinds[4].first.fd = true;
  kinds[5].first.remote = kinds[6].first.remote = true;
  kinds[6].first.length = 4;
  kinds[7].first.error = true;
  return kinds;
}

TEST(Candump, WritesTheTextOfEveryKindAndReadsItBack) {
  for (const auto& [sent, text] : every_kind()) {
    EXPECT_EQ(text_of(sent), text);
    const auto read = parse_frame_text(text);
    ASSERT_TRUE(read) << read.error();
    EXPECT_TRUE(same(sent, *read)) << text;
  }
}

TEST(Candump, LinesCutNanosecondsToMicroseconds) {
  EXPECT_EQ(line_of(frame(0x123, {0xDE, 0xAD}), 1'700'000'000'123'456'999, FrameDirection::received),
            "(1700000000.123456) can0 123#DEAD R\n");
  EXPECT_EQ(line_of(frame(0x123, {}), 5'000'001'000, FrameDirection::sent), "(0000000005.000001) can0 123# T\n");
  EXPECT_EQ(line_of(frame(0x123, {}), 5'000'001'000, FrameDirection::refused),
            "# refused: (0000000005.000001) can0 123# T\n");
  EXPECT_FALSE(parse_candump_line("# refused: (0000000005.000001) can0 123# T")) << "never taken for a frame";
}

TEST(Candump, MonotonicStampsBecomeUnixTime) {
  std::string line;
  append_candump_line(line, drivers::to_record(frame(0x1, {}), MonoTime{2'000'000'000}, 0, 0, FrameDirection::sent),
                      "can1", 1'700'000'000'000'000'000);
  EXPECT_EQ(line, "(1700000002.000000) can1 001# T\n");
}

TEST(Candump, ReadsLinesWithAndWithoutADirection) {
  for (const char* line : {"(1700000000.123456) can0 123#DEAD\n", "(1700000000.123456) can0 123#DEAD R",
                           "(1700000000.123456)  can0  123#dead\r\n"}) {
    const auto logged = parse_candump_line(line);
    ASSERT_TRUE(logged) << logged.error();
    EXPECT_EQ(logged->unix_ns, 1'700'000'000'123'456'000);
    EXPECT_EQ(logged->interface, "can0");
    EXPECT_TRUE(same(logged->frame, frame(0x123, {0xDE, 0xAD})));
    EXPECT_EQ(logged->direction, FrameDirection::received);
  }
  EXPECT_EQ(parse_candump_line("(1.000000) can0 123#DEAD T")->direction, FrameDirection::sent);
}

TEST(Candump, RefusesWhatIsNoFrame) {
  for (const char* text :
       {"", "#", "123", "12#00", "1234#00", "800#00", "123#0", "123#GG", "123#001122334455667788", "123##",
        "123##1001122334455667788", "123#R9", "123#Rx", "XYZ#00", "FFFFFFFF#00", "123# 00", "-12#00"})
    EXPECT_FALSE(parse_frame_text(text)) << text;
  for (const char* line :
       {"", "can0 123#00", "(1.0) can0 123#00", "(1.000000) 123#00", "(1.000000) can0", "(-1.000000) can0 123#00",
        "(1.000000) can0 123#00 X", "(1.000000) can0 123#00 R R", "(x.000000) can0 123#00"})
    EXPECT_FALSE(parse_candump_line(line)) << line;
}

TEST(Candump, ARecordThatIsNoFrameIsWrittenAsAComment) {
  FrameRecord broken;
  broken.length = 200;
  std::string line;
  append_candump_line(line, broken, "can0", 0);
  EXPECT_TRUE(line.starts_with("# "));
  EXPECT_TRUE(line.ends_with("\n"));
  EXPECT_FALSE(parse_candump_line(line));
}

TEST(Candump, AnyTextIsReadOrRefusedWithoutHarm) {
  EXPECT_TRUE(rc::check([](const std::string& text) {
    (void)parse_frame_text(text);
    (void)parse_candump_line(text);
  }));
  // Near misses: a good line with a few characters changed.
  EXPECT_TRUE(rc::check([](std::uint8_t position, char changed) {
    std::string line = "(1700000000.123456) can0 123##1AABBCCDD R";
    line[position % line.size()] = changed;
    const auto logged = parse_candump_line(line);
    if (logged) RC_ASSERT(is_legal(logged->frame));
  }));
}

// Runs a command and returns what it wrote and its exit status.
std::pair<std::string, int> run(const std::string& command) {
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(::popen(command.c_str(), "r"), [](std::FILE*) { return 0; });
  std::string out;
  std::array<char, 4096> buffer;
  while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe.get())) out.append(buffer.data(), n);
  return {out, ::pclose(pipe.release())};
}

TEST(Candump, PythonCanReadsOurLog) {
  constexpr const char* kPython = "/usr/bin/python3";
  if (run(std::string(kPython) + " -c 'import can' 2>/dev/null").second != 0)
    GTEST_SKIP() << "python3-can is not installed: OUR CAN LOGS WERE NOT CHECKED against an independent reader";
  const std::filesystem::path log = std::filesystem::path(testing::TempDir()) / "takt_candump.log";
  std::ofstream file(log);
  std::int64_t stamp = 1'700'000'000'000'001'500;
  for (const auto& [sent, text] : every_kind()) file << line_of(sent, stamp += 1'000'000, FrameDirection::sent);
  file.close();
  const char* script =
      "import can,sys\n"
      "for m in can.CanutilsLogReader(sys.argv[1]):\n"
      "  print(f'{m.timestamp:.6f} {m.channel} {m.arbitration_id:x} {int(m.is_extended_id)} {int(m.is_fd)} "
      "{int(m.bitrate_switch)} {int(m.is_remote_frame)} {int(m.is_rx)} {m.dlc} {bytes(m.data).hex()}')\n";
  const std::filesystem::path program = std::filesystem::path(testing::TempDir()) / "takt_candump.py";
  std::ofstream(program) << script;
  const auto [out, status] = run(std::string(kPython) + " " + program.string() + " " + log.string() + " 2>&1");
  ASSERT_EQ(status, 0) << out;
  EXPECT_EQ(out,
            "1700000000.001001 can0 123 0 0 0 0 0 4 deadbeef\n"
            "1700000000.002001 can0 1 0 0 0 0 0 0 \n"
            "1700000000.003001 can0 12345 1 0 0 0 0 1 01\n"
            "1700000000.004001 can0 123 0 1 1 0 0 2 aabb\n"
            "1700000000.005001 can0 7ff 0 1 0 0 0 1 00\n"
            "1700000000.006001 can0 10 0 0 0 1 0 0 \n"
            "1700000000.007001 can0 10 0 0 0 1 0 4 \n"
            "1700000000.008001 can0 40 1 0 0 0 0 8 0000000000000000\n");
}

}  // namespace
}  // namespace takt::monitor
