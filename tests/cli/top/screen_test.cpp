// SPDX-License-Identifier: Apache-2.0
// Goal: the screen fits every terminal and says everything that matters at 80 x 24, twelve joints and four buses
// included. Method: whole screens against files (written anew by TAKT_WRITE_SCREENS=1, then read by a person); a
// property over arbitrary sizes and robots; what must stand out, by its style.
#include "cli/top/screen.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstdlib>
#include <fstream>

#include "tests/cli/top/sample_picture.hpp"
#include "tests/support/files.hpp"

namespace takt::monitor::top {
namespace {

std::string text_of(const std::vector<Line>& lines) {
  std::string text;
  for (const Line& line : lines) {
    text += line.text();
    text.erase(text.find_last_not_of(' ') + 1);
    text += '\n';
  }
  return text;
}

void expect_screen(const std::string& name, const std::vector<Line>& lines) {
  const std::string path = "tests/cli/top/screens/" + name + ".txt";
  if (std::getenv("TAKT_WRITE_SCREENS") != nullptr) std::ofstream(path) << text_of(lines);
  const std::string golden = test::text_of(path);
  EXPECT_EQ(text_of(lines), golden) << path;
}

// The style of the piece that holds this text.
Style style_of(const std::vector<Line>& lines, std::string_view text) {
  for (const Line& line : lines)
    for (const Piece& piece : line.pieces())
      if (piece.text.find(text) != std::string::npos) return piece.style;
  ADD_FAILURE() << "`" << text << "` is nowhere in\n" << text_of(lines);
  return Style::plain;
}

TEST(Screen, TwelveJointsAndFourBusesFit) {
  const auto lines = render(sample_picture(12, 4), {}, {24, 80}, Glyphs::unicode);
  ASSERT_EQ(lines.size(), 24U);
  expect_screen("dual_arm_80x24", lines);
  for (int joint = 1; joint <= 12; ++joint)
    EXPECT_NE(text_of(lines).find("joint_" + std::to_string(joint) + " "), std::string::npos) << joint;
}

TEST(Screen, WithFewerJointsTheAgePlotGrows) {
  expect_screen("arm_80x24", render(sample_picture(6, 2), {}, {24, 80}, Glyphs::unicode));
}

TEST(Screen, AsciiIsAsciiOnly) {
  const auto lines = render(sample_picture(6, 2), {}, {24, 80}, Glyphs::ascii);
  expect_screen("arm_80x24_ascii", lines);
  for (const char c : text_of(lines)) EXPECT_LT(static_cast<unsigned char>(c), 0x80U);
}

TEST(Screen, TheListOfJointsScrollsAndSaysWhereItIs) {
  const Picture picture = sample_picture(12, 4);
  const std::string top = text_of(render(picture, {}, {18, 80}, Glyphs::unicode));
  EXPECT_NE(top.find("1-6 of 12 (j k)"), std::string::npos) << top;
  EXPECT_NE(top.find("joint_6 "), std::string::npos);
  EXPECT_EQ(top.find("joint_7 "), std::string::npos);
  const std::string bottom = text_of(render(picture, {.scroll = 99}, {18, 80}, Glyphs::unicode));
  EXPECT_NE(bottom.find("7-12 of 12"), std::string::npos) << bottom;
  EXPECT_NE(bottom.find("joint_12 "), std::string::npos) << "scrolled too far is scrolled to the end";
}

TEST(Screen, WithoutAnExecutiveItSaysWhy) {
  Picture picture{.link = Link::waiting, .why = "nobody listens at /run/takt/arm6/executive.sock", .robot = "arm6"};
  const std::string text = text_of(render(picture, {}, {24, 80}, Glyphs::unicode));
  EXPECT_NE(text.find("WAITING for the executive"), std::string::npos) << text;
  EXPECT_NE(text.find("nobody listens at /run/takt/arm6/executive.sock"), std::string::npos) << text;
}

TEST(Screen, AHangingLoopIsNotShownAsAlive) {
  Picture picture = sample_picture(6, 2);
  picture.link = Link::silent;
  picture.since_tick = milliseconds(2500);
  const auto lines = render(picture, {}, {24, 80}, Glyphs::unicode);
  EXPECT_NE(lines[0].text().find("NO TICK for 2.5 s, was tracking"), std::string::npos) << lines[0].text();
  EXPECT_EQ(style_of(lines, "NO TICK"), Style::alarm);
}

TEST(Screen, WhatIsWrongStandsOut) {
  Picture picture = sample_picture(6, 2);
  EXPECT_EQ(style_of(render(picture, {}, {24, 80}, Glyphs::unicode), "TRACKING"), Style::good);
  picture.tick.mode = Mode::damped_stop;
  picture.tick.seats[Seat::policy].freshness = Freshness::stale;
  picture.tick.window_misses = 100;
  picture.tick.recorded_through = 0;
  picture.buses[0].health.state = BusState::bus_off;
  picture.joints[0].error = "over-temperature";
  picture.joints[1].newest.behind = 1;
  const auto lines = render(picture, {}, {24, 80}, Glyphs::unicode);
  for (const char* alarm : {"DAMPED_STOP", "stale", "100/1000", "violated", "bus-off", "over-temperature"})
    EXPECT_EQ(style_of(lines, alarm), Style::alarm) << alarm;
  for (const char* warning :
       {"UNRECORDED", "NOT REAL TIME", "preempted 2", "tx lost 12", "velocity_limit 17", "behind its reference"})
    EXPECT_EQ(style_of(lines, warning), Style::warning) << warning;
}

TEST(Screen, TheLastLineAsksAnswersOrNamesTheKeys) {
  const Picture picture = sample_picture(6, 2);
  const auto last = [&](const Prompt& prompt) {
    return render(picture, prompt, {24, 80}, Glyphs::unicode).back().text();
  };
  EXPECT_NE(last({}).find("q quit"), std::string::npos);
  EXPECT_EQ(last({.note = "marked tick 7"}), "marked tick 7");
  EXPECT_EQ(last({.confirms_arm = true, .note = "marked tick 7"}).substr(0, 4), "ARM:") << "a question comes first";
}

TEST(Screen, HelpNamesEveryKey) {
  const std::string text = text_of(render(sample_picture(12, 4), {.help = true}, {24, 80}, Glyphs::unicode));
  for (const char* key : {"a  arm", "s  stop", "r  reset", "m  mark", "p  snapshot", "?  this help", "q  quit"})
    EXPECT_NE(text.find(key), std::string::npos) << key;
}

TEST(Screen, TooSmallIsOneLine) {
  const auto lines = render(sample_picture(6, 2), {}, {15, 80}, Glyphs::unicode);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0].text(), "too small: 72x16 needed");
}

TEST(Screen, FitsEveryTerminal) {
  EXPECT_TRUE(rc::check("never more lines than rows, never wider than columns", [] {
    const Size size{*rc::gen::inRange<std::size_t>(0, 60), *rc::gen::inRange<std::size_t>(0, 200)};
    Picture picture = sample_picture(*rc::gen::inRange<std::size_t>(0, kMaxJoints + 1),
                                     *rc::gen::inRange<std::size_t>(0, kMaxBuses + 1));
    for (JointPicture& joint : picture.joints) {
      joint.name.append(*rc::gen::inRange<std::size_t>(0, 60), 'x');
      joint.recent = *rc::gen::inRange<InterventionMask>(0, 1024);
    }
    picture.link = *rc::gen::element(Link::waiting, Link::live, Link::silent);
    picture.why = std::string(*rc::gen::inRange<std::size_t>(0, 300), 'y');
    Prompt prompt{.confirms_arm = *rc::gen::arbitrary<bool>(),
                  .help = *rc::gen::arbitrary<bool>(),
                  .scroll = *rc::gen::inRange<std::size_t>(0, 100)};
    const auto lines = render(picture, prompt, size, *rc::gen::element(Glyphs::unicode, Glyphs::ascii));
    RC_ASSERT(lines.size() <= size.rows);
    for (const Line& line : lines) RC_ASSERT(line.width() <= size.columns);
    if (size.rows >= kLeast.rows && size.columns >= kLeast.columns) RC_ASSERT(lines.size() == size.rows);
  }));
}

}  // namespace
}  // namespace takt::monitor::top
