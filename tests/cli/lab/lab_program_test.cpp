// SPDX-License-Identifier: Apache-2.0
// Goal: `takt` finds each command of the lab as if it were its own, and says where to get it when takt-lab is not
// installed. Method: the real binaries, beside each other and in a folder without takt-lab.
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>

#include "cli/lab_commands.hpp"
#include "tests/cli/shell.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;

std::string words_of(const LabCommand& command) {
  return (command.parent.empty() ? "" : std::string(command.parent) + " ") + std::string(command.name);
}

using LabProgram = test::Shell;

TEST_F(LabProgram, EveryCommandIsFoundUnderTakt) {
  for (const LabCommand& command : lab_commands()) {
    const std::string words = words_of(command), sentence(command.sentence);
    EXPECT_EQ(takt(words + " --help").output.find(sentence), 0U) << words;
    EXPECT_EQ(takt("help " + words).output, takt(words + " --help").output);
    const std::string listed = takt("help " + std::string(command.parent)).output;
    const std::regex line("\n  (.*, )?" + std::string(command.name) + "( |,|\n)");
    EXPECT_TRUE(std::regex_search(listed, line)) << words << "\n" << listed;
  }
  EXPECT_EQ(takt("policy tyr x").output,
            "takt: there is no command `takt policy tyr`; did you mean `takt policy try`? `takt help policy` lists "
            "them\n");
  EXPECT_EQ(
      takt("panel rnu x").output,
      "takt: there is no command `takt panel rnu`; did you mean `takt panel run`? `takt help panel` lists them\n");
}

TEST_F(LabProgram, IsNamedWhereItIsMissing) {
  for (const char* ours : {"takt", "takt-operate"}) fs::copy(std::string(TAKT_BIN_DIR) + "/" + ours, in(ours));
  for (const LabCommand& command : lab_commands()) {
    const test::Ended ended = shell(in("takt ") + words_of(command) + " x");
    EXPECT_EQ(ended.exit_code, 69) << ended.output;
    EXPECT_EQ(ended.output, "takt: this command is in the package takt-lab, and " + in("takt-lab") +
                                " is not there: install takt-lab\n");
  }
  EXPECT_EQ(shell(in("takt help")).output, takt("help").output);
  const test::Ended by_itself = shell(in("takt-operate panel"));
  EXPECT_EQ(by_itself.exit_code, 64);
  EXPECT_EQ(by_itself.output, "takt-operate does not carry this command: type `takt`, which finds who does\n");
}

}  // namespace
}  // namespace takt::cli
