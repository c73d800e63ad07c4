// SPDX-License-Identifier: Apache-2.0
// Goal: a row comes back from its line exactly, and nothing but a whole and sensible row is ever written or read.
// Method: round trips; then every field of the table in turn is left out, given another type, made not finite.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "evidence/attestation/attestation.hpp"
#include "lab/artifact/rollout_fields.hpp"
#include "lab/artifact/rollout_json.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/strict_json.hpp"
#include "tests/lab/artifact/sample_rows.hpp"

namespace takt::lab {
namespace {

using Json = nlohmann::ordered_json;

nlohmann::ordered_json::json_pointer pointer_of(const RolloutField& field) {
  std::string pointer = "/" + field.name;
  for (char& c : pointer) c = c == '.' ? '/' : c;
  return Json::json_pointer(pointer);
}

Json sample_json() {
  return Json::parse(row_text(sample_row()).value());
}

std::string refusal(const Json& json) {
  const auto row = row_of(json.dump());
  return row ? "accepted" : row.error();
}

TEST(RolloutRow, ComesBackFromItsLine) {
  for (const evidence::RolloutRow& row : {sample_row(), failed_row()}) {
    const std::string text = row_text(row).value();
    EXPECT_EQ(text.find('\n'), std::string::npos);
    const auto back = row_of(text);
    ASSERT_TRUE(back) << back.error();
    EXPECT_EQ(row_text(*back).value(), text);
    for (const RolloutField& field : rollout_fields()) {
      const FieldPlace a = place_in(field, row), b = place_in(field, *back);
      std::visit(
          [&](auto* left) {
            auto* const* right = std::get_if<decltype(left)>(&b);
            ASSERT_NE(right, nullptr);
            EXPECT_TRUE(*left == **right) << field.name;
          },
          a);
    }
  }
}

// Every field has its own place: a sample without equal neighbours would show a place given twice.
TEST(RolloutRow, EveryFieldHasItsOwnNameAndPlace) {
  evidence::RolloutRow row;
  std::set<std::string> names;
  std::set<const void*> places;
  for (const RolloutField& field : rollout_fields()) {
    EXPECT_TRUE(names.insert(field.name).second) << field.name;
    const void* place = std::visit([](auto* each) -> const void* { return each; }, field.place(row));
    EXPECT_TRUE(places.insert(place).second) << field.name;
    EXPECT_FALSE(field.meaning.empty()) << field.name;
  }
  EXPECT_EQ(names.size(), 124U);  // 13 + 12 + 9 + 9 + 2 + 2 * 18 + 2 * 5 + 4 + 12 + 6 + 5 + 2 + 4
}

TEST(RolloutRow, HostMeasurementsStayOutOfTheComparedBytes) {
  evidence::RolloutRow slower = sample_row();
  slower.host.wall_s = 99;
  EXPECT_NE(row_text(slower).value(), row_text(sample_row()).value());
  EXPECT_EQ(row_text(slower, HostFields::left_out).value(), row_text(sample_row(), HostFields::left_out).value());
  EXPECT_EQ(row_text(slower, HostFields::left_out).value().find("host"), std::string::npos);
}

TEST(RolloutRow, AMissingFieldIsRefusedByName) {
  for (const RolloutField& field : rollout_fields()) {
    if (field.is_added) continue;
    Json json = sample_json();
    const auto pointer = pointer_of(field);
    json.at(pointer.parent_pointer()).erase(pointer.back());
    EXPECT_EQ(refusal(json), field.name + " is missing");
  }
}

// A row of an earlier program lacks the added fields, all of them, and is written again as it was.
TEST(RolloutRow, AnAddedFieldMayBeMissing) {
  Json json = sample_json();
  json["faults"].erase("shares");
  const auto row = row_of(json.dump());
  ASSERT_TRUE(row) << row.error();
  EXPECT_EQ(row_text(*row).value(), json.dump());
  json = sample_json();
  json["faults"]["shares"].erase("unknown");
  EXPECT_EQ(refusal(json), "has 8 of 9 faults.shares");
  json = sample_json();
  json["faults"]["shares"]["unknown"] = 0.5;
  EXPECT_EQ(refusal(json), "faults.shares add up to 1.5, not to 1");
}

TEST(RolloutRow, AWrongTypeIsRefusedByName) {
  for (const RolloutField& field : rollout_fields()) {
    if (field.name == "schema") continue;
    for (const Json& wrong : {Json::array(), Json::object()}) {
      Json json = sample_json();
      json[pointer_of(field)] = wrong;
      evidence::RolloutRow row;
      const std::string type(type_name(field.place(row)));
      EXPECT_EQ(refusal(json), field.name + " is " + wrong.dump() + ", not " + type);
    }
  }
  Json json = sample_json();
  json["seed"] = 1.5;
  EXPECT_EQ(refusal(json), "seed is 1.5, not a whole number");
  json["seed"] = -1;
  EXPECT_EQ(refusal(json), "seed is -1, not a whole number");
  json["seed"] = kLargestCount + 1;
  EXPECT_EQ(refusal(json), "seed is 9007199254740992, above 2^53 - 1");
  json = sample_json();
  json["energy_J"] = nullptr;
  EXPECT_EQ(refusal(json), "energy_J is null, not a number");
  json = sample_json();
  json["monitor_state"]["mode"] = "sleeping";
  EXPECT_EQ(refusal(json), "monitor_state.mode is \"sleeping\", not the name of a mode");
}

TEST(RolloutRow, AnUnknownOrRepeatedFieldIsRefusedByName) {
  Json json = sample_json();
  json["sucess"] = true;
  EXPECT_EQ(refusal(json), "sucess is not a field of takt.rollout/1");
  json = sample_json();
  json["age_per_tick"]["total"]["p90_ms"] = 1;
  EXPECT_EQ(refusal(json), "age_per_tick.total.p90_ms is not a field of takt.rollout/1");
  std::string twice = sample_json().dump();
  twice.insert(1, "\"success\":false,");
  EXPECT_EQ(row_of(twice).error(), "success is there twice");
}

TEST(RolloutRow, ARowOfAnotherVersionSaysSo) {
  Json json = sample_json();
  json["schema"] = "takt.rollout/2";
  EXPECT_EQ(refusal(json), "schema is \"takt.rollout/2\", this version reads \"takt.rollout/1\"");
}

TEST(RolloutRow, TornTextIsRefused) {
  const std::string text = row_text(sample_row()).value();
  for (const std::size_t length : {std::size_t{0}, text.size() / 2, text.size() - 1}) {
    EXPECT_EQ(row_of(text.substr(0, length)).error(), "not JSON, or cut off");
  }
  EXPECT_EQ(row_of("[1]").error(), "not a JSON object");
}

TEST(RolloutRow, NothingThatIsNotFiniteIsWritten) {
  for (const RolloutField& field : rollout_fields()) {
    for (const double wrong : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      evidence::RolloutRow row = sample_row();
      const FieldPlace place = field.place(row);
      if (auto* const* number = std::get_if<double*>(&place))
        **number = wrong;
      else if (auto* const* optional = std::get_if<std::optional<double>*>(&place))
        **optional = wrong;
      else
        continue;
      EXPECT_EQ(row_text(row).error(), field.name + " is not finite");
    }
  }
}

TEST(RolloutRow, ValuesOutsideTheirRangeOrFormatAreRefused) {
  evidence::RolloutRow row = sample_row();
  row.mode_share[2] = 1.5;
  EXPECT_EQ(row_text(row).error(), "mode_share.tracking is 1.5, outside 0..1");
  row = sample_row();
  row.energy_J = -1;
  EXPECT_EQ(row_text(row).error(), "energy_J is -1, outside 0 or more");
  row = sample_row();
  row.task = "Reach it";
  EXPECT_EQ(row_text(row).error(), "task is \"Reach it\", not ^[a-z0-9_-][a-z0-9_.-]*$");
  row = sample_row();
  row.config_sha256 = "12";
  EXPECT_EQ(row_text(row).error(), "config_sha256 is \"12\", not ^[0-9a-f]{64}$");
  row = sample_row();
  row.run_folder = "../elsewhere";
  EXPECT_EQ(row_text(row).error(), "run_folder is \"../elsewhere\", not ^(?!/)(?!.*\\.\\.)[ -~]*$");
  row = sample_row();
  row.leading_fault = "gremlins";
  EXPECT_NE(row_text(row).error().find("faults.leading is \"gremlins\", not ^(sensor_backlog|"), std::string::npos);
  row.leading_fault = "";
  EXPECT_EQ(row_text(row).error(), "faults.leading is \"\" with 2 verdicts");
  row = sample_row();
  row.failure_label = "late";
  EXPECT_EQ(row_text(row).error(), "failure_label is set on a success");
  row = failed_row();
  row.failure_label.clear();
  EXPECT_EQ(row_text(row).error(), "failure_label is empty on a failure");
  row = sample_row();
  row.misses_per_tick.misses = 1001;
  EXPECT_EQ(row_text(row).error(), "misses_per_tick.misses is 1001 of only 1000");
}

// The committed schema is what the table says. When this fails after a change of the table: bump kRolloutSchema if
// old rows no longer read, then write rollout_schema() to the file (TAKT_WRITE_SCHEMA=1 does it).
TEST(RolloutSchema, CommittedFileMatchesTheTable) {
  const std::string path = "lab/artifact/rollout.schema.json";
  if (std::getenv("TAKT_WRITE_SCHEMA") != nullptr) {
    ASSERT_TRUE(monitor::replace_file(path, rollout_schema()));
  }
  EXPECT_EQ(monitor::read_file(path).value(), rollout_schema());
}

// Goal: a refusal that quotes what a stranger wrote moves no cursor. Method: DEL and a C1 character, which JSON lets
// stand.
TEST(RolloutRow, RefusalsShowWhatATerminalWouldObey) {
  for (const std::string odd : {"\x7f", "\xc2\x9b"}) {
    const std::string twice = "{\"" + odd + "\": 1, \"" + odd + "\": 2}";
    const std::vector<std::string> refusals{row_of("{\"schema\": \"" + odd + "\"}").error(), row_of(twice).error(),
                                            evidence::attestation_of("{\"schema\": \"" + odd + "\"}").error(),
                                            monitor::parse_strict(twice).error()};
    for (const std::string& refusal : refusals) {
      EXPECT_FALSE(refusal.empty());
      EXPECT_EQ(refusal.find(odd), std::string::npos) << refusal;
    }
  }
}

TEST(RolloutRow, IdNamesTheRolloutAndIsASafeFileName) {
  evidence::RolloutRow row = sample_row("fast", 7);
  row.perturbation = "slow_infer";
  row.dose = 2.5;
  EXPECT_EQ(evidence::rollout_id(row), "reach.slow_infer@2.5.fast.s7");
}

}  // namespace
}  // namespace takt::lab
