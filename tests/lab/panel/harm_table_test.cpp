// SPDX-License-Identifier: Apache-2.0
// Goal: the table says of each cell whether Takt keeps the margin, from pairs alone. Method: rows made by hand.
#include "lab/panel/harm_table.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace takt::lab {
namespace {

void add(std::vector<evidence::RolloutRow>& rows, const char* method, const char* perturbation, std::uint64_t seeds,
         std::uint64_t failures) {
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    evidence::RolloutRow row;
    row.task = "arm_tracking";
    row.method = method;
    row.perturbation = perturbation;
    row.seed = seed;
    row.success = seed > failures;
    rows.push_back(row);
  }
}

// The line that has all the words.
std::string line_with(const std::string& table, std::initializer_list<const char*> words) {
  for (std::size_t at = 0; at < table.size();) {
    const std::size_t end = table.find('\n', at);
    const std::string line = table.substr(at, end - at);
    if (std::ranges::all_of(words, [&](const char* word) { return line.find(word) != std::string::npos; })) return line;
    at = end + 1;
  }
  return {};
}

TEST(HarmTable, JudgesEachRivalByItsPairs) {
  std::vector<evidence::RolloutRow> rows;
  add(rows, "takt", "none", 200, 0);
  add(rows, "plain", "none", 200, 0);
  add(rows, "takt", "push", 200, 30);
  add(rows, "plain", "push", 200, 0);
  add(rows, "timeout", "push", 200, 90);
  add(rows, "mine", "push", 200, 0);
  add(rows, "plain", "friction", 200, 0);  // without a partner
  const std::string table = harm_table(rows);
  EXPECT_NE(line_with(table, {"arm_tracking", "none", "plain"}).find("holds"), std::string::npos) << table;
  EXPECT_NE(line_with(table, {"arm_tracking", "push", "plain", "-15.0"}).find("fails"), std::string::npos) << table;
  EXPECT_NE(line_with(table, {"arm_tracking", "push", "timeout", "+30.0"}).find("better"), std::string::npos) << table;
  EXPECT_NE(line_with(table, {"all", "troubled", "timeout"}), "") << table;
  EXPECT_EQ(line_with(table, {"mine"}), "") << table;
  EXPECT_EQ(line_with(table, {"friction"}), "") << table;
}

TEST(HarmTable, FewSeedsShowNothing) {
  std::vector<evidence::RolloutRow> rows;
  add(rows, "takt", "none", 10, 0);
  add(rows, "plain", "none", 10, 0);
  EXPECT_NE(harm_table(rows).find("open"), std::string::npos);
  EXPECT_EQ(harm_table(std::span(rows).first(10)), "") << "no rival";
}

}  // namespace
}  // namespace takt::lab
