// SPDX-License-Identifier: Apache-2.0
// Goal: the table of troubles is whole, what a panel's kind is made of is in it, and the pages that list kinds list
// these with these doses. Method: every row; every page as text.
#include "config/trouble/kinds.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>

#include "config/trouble/line.hpp"
#include "tests/support/files.hpp"

namespace takt::trouble {
namespace {

TEST(TroubleKinds, EveryRowIsWhole) {
  for (const Place place : {Place::run, Place::policy_host, Place::plant, Place::panel}) {
    std::set<std::string_view> names;
    for (const Row& row : rows(place)) {
      EXPECT_EQ(row.place, place);
      EXPECT_TRUE(names.insert(row.name).second) << row.name;
      EXPECT_EQ(find(place, row.name), &row);
      EXPECT_FALSE(row.effect.empty()) << row.name;
      EXPECT_LE(row.dose.least, row.dose.most) << row.name;
      EXPECT_LE(row.longest, kLongestTime) << row.name;
    }
    EXPECT_EQ(find(place, "nap"), nullptr);
  }
  for (const Row& row : rows(Place::panel))
    EXPECT_TRUE(row.dose.least <= row.dose.moderate && row.dose.moderate <= row.dose.most) << row.name;
}

TEST(TroubleKinds, WhatAPanelsKindIsMadeOfIsInTheTable) {
  for (const Row& row : rows(Place::panel).subspan(1)) {
    const Real& real = row.real;
    if (real.by == Place::panel) {
      EXPECT_FALSE(real.as.empty()) << row.name << ": nothing does it, and nothing says why";
      continue;
    }
    const std::size_t blank = real.as.find(' ');
    const Row* const mechanism = find(real.by, real.as.substr(0, blank));
    ASSERT_NE(mechanism, nullptr) << row.name;
    EXPECT_EQ(real.by == Place::plant, real.whom != Whom::nothing) << row.name;
    EXPECT_TRUE(blank == std::string_view::npos ||
                std::ranges::count(mechanism->strikes.words, real.as.substr(blank + 1)) == 1)
        << row.name;
    // A dose either is the mechanism's, in its unit, or says how long it lasts.
    EXPECT_TRUE(mechanism->dose.unit.empty() || mechanism->dose.whole || mechanism->dose.unit == row.dose.unit)
        << row.name;
    EXPECT_TRUE(real.then.empty() || parse_line(fmt::format("1 s: {}", real.then), Place::run)) << row.name;
  }
}

TEST(TroubleKinds, PagesListTheseKindsWithTheseDoses) {
  const std::string panels = test::text_of("docs/panels.md");
  for (const Row& row : rows(Place::panel).subspan(1)) {
    const bool has_unit = row.dose.dimension() != config::Dimension::none;
    const std::string item =
        fmt::format("`{}` ({:g}{}{})", row.name, row.dose.moderate, has_unit ? " " : "", has_unit ? row.dose.unit : "");
    EXPECT_NE(panels.find(item), std::string::npos) << "docs/panels.md lacks " << item;
  }
  const std::string scenarios = test::text_of("docs/plant-scenarios.md");
  for (const Row& row : rows(Place::plant)) {
    const bool has_key = !row.dose.unit.empty() || row.as<FaultKind>() == FaultKind::error;
    const std::string item = has_key ? fmt::format("`{}:`", row.name) : fmt::format("`fault: {}`", row.name);
    const std::size_t at = scenarios.find("- " + item);
    ASSERT_NE(at, std::string::npos) << "docs/plant-scenarios.md lacks " << item;
    if (row.dose.unit.empty()) continue;
    const std::string line = scenarios.substr(at, scenarios.find('\n', at) - at);
    const bool is_seconds = row.dose.unit == "ms" && row.dose.most >= 1000;
    const std::string most =
        fmt::format("{:g}{}", is_seconds ? row.dose.most / 1000 : row.dose.most, is_seconds ? " s" : "");
    EXPECT_NE(line.find(most), std::string::npos) << line << ": lacks the largest dose " << most;
  }
  const std::string real_time = test::text_of("docs/panels-real-time.md");
  for (const Row& row : rows(Place::panel).subspan(1))
    if (row.real.by == Place::policy_host || row.real.by == Place::panel) {
      EXPECT_NE(real_time.find(fmt::format("`{}`", row.name)), std::string::npos) << row.name;
    }
}

}  // namespace
}  // namespace takt::trouble
