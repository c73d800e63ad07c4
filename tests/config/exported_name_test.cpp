// SPDX-License-Identifier: Apache-2.0
// Goal: a name out of another's file stays a name, wherever it comes to stand. Method: names that exporters write, and
// such as would be read as more; text of any kind, written and read back by the robot file's own reader.
#include "config/exported_name.hpp"

#include <gtest/gtest.h>

#include "config/document.hpp"
#include "config/robot_text.hpp"

namespace takt::config {
namespace {

TEST(ExportedName, IsWhatExportersWrite) {
  for (const char* const name :
       {"robot_joint_pos", "/actor/Gemm_output_0", "onnx::Gemm_12", "obj.robot.pelvis.w_Q_b", "state:robot:root_quat_w",
        "state/body/linear_velocity", "left hip (pitch)", "1", "a+b", "h-1"})
    EXPECT_EQ(why_no_name(name), "") << name;
}

TEST(ExportedName, IsNothingThatYamlWouldReadAsMore) {
  for (const char* const name : {"",
                                 "x\n    timeout: 60 s",
                                 "q\"\n  nice: -20 #",
                                 "a # b",
                                 "a: b",
                                 "a:",
                                 " a",
                                 "a ",
                                 "it's",
                                 "back\\slash",
                                 "{a}",
                                 "[a]",
                                 "a,b",
                                 "*a",
                                 "&a",
                                 "!a",
                                 "a\tb",
                                 "a\x1b[31m",
                                 "Ta\xc3\xafl",
                                 "\xe2\x80\xae"
                                 "abc",
                                 "`a",
                                 "@a",
                                 "a|b",
                                 "%a"}) {
    const std::string why = why_no_name(name);
    EXPECT_NE(why, "") << name;
    EXPECT_EQ(why.find('\n'), std::string::npos) << why;
  }
  EXPECT_EQ(
      why_no_name("x\n  nice: -20"),
      "\"x\\n  nice: -20\" holds \"\\n\", and is no name; use up to 127 letters, digits, blanks and _ - + . / : ( )");
  EXPECT_TRUE(why_no_name("\xe2\x80\xae"
                          "abc")
                  .starts_with(R"("\xe2\x80\xaeabc" holds "\xe2")"));
  EXPECT_NE(why_no_name(std::string(200, 'a')).find("has 200 characters"), std::string::npos);
}

TEST(RobotText, ReadsBackAsItWas) {
  for (const std::string text :
       {"plain", "it's", "q\"\n  nice: -20 #", "back\\slash", "a # b", "", "\\n", "Ta\xc3\xafl", "no", "1e3"}) {
    Problems problems("text");
    const Node root = read_document("key: " + in_quotes(text) + "\n", Tags::refuse, problems);
    ASSERT_TRUE(problems.empty()) << problems.text();
    ASSERT_EQ(root.entries.size(), 1U) << text;
    EXPECT_EQ(root.entries[0].value.text, text);
  }
  EXPECT_EQ(plain_or_quoted("left_knee"), "left_knee");
  EXPECT_EQ(plain_or_quoted("left knee"), "\"left knee\"");
  EXPECT_EQ(on_one_line("a\nb\x1b"), "a\\nb\\x1b");
}

}  // namespace
}  // namespace takt::config
