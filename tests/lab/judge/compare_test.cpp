// SPDX-License-Identifier: Apache-2.0
// Goal: methods are compared pair by pair with the right numbers, and mixtures are refused with their reason.
// Method: artifacts whose differences are known by hand; then one planted difference at a time.
#include "lab/judge/compare.hpp"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <random>

#include "config/load.hpp"
#include "lab/artifact/merge.hpp"
#include "lab/judge/exact_rate_interval.hpp"
#include "tests/lab/artifact/sample_artifact.hpp"
#include "tests/lab/artifact/sample_rows.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::lab {
namespace {

class CompareTest : public test::TemporaryFolder {
 protected:
  // Ten seeds, nominal and stalled. `fails(seed)` decides the stalled rollouts; ages are 20 ms + shift.
  Artifact artifact_of(const std::string& method, double shift_ms, bool (*fails)(std::uint64_t),
                       void (*change)(ArtifactManifest&, evidence::RolloutRow&) = nullptr) const {
    ArtifactManifest manifest = sample_manifest({method}, 20);
    std::vector<evidence::RolloutRow> rows;
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      for (const bool stalled : {false, true}) {
        evidence::RolloutRow row = stalled && fails(seed) ? failed_row(method, seed) : sample_row(method, seed);
        row.perturbation = stalled ? "stall" : "none";
        row.dose = stalled ? 400 : 0;
        row.age_per_command.total.p95_ms = 20 + shift_ms;
        row.age_per_command.total.p99_ms = 21 + shift_ms;
        if (change != nullptr) change(manifest, row);
        rows.push_back(std::move(row));
      }
    }
    return write_artifact(path(method + std::to_string(folders_++)), manifest, rows);
  }
  mutable int folders_ = 0;
};

bool never(std::uint64_t /*seed*/) {
  return false;
}
bool often(std::uint64_t seed) {
  return seed > 2;
}

std::string refusal(const std::expected<Comparison, std::string>& comparison) {
  return comparison ? "compared" : comparison.error();
}

const MetricDifference& metric(const GroupComparison& group, std::string_view name) {
  return *std::ranges::find(group.metrics, name, &MetricDifference::metric);
}

TEST_F(CompareTest, PairsRowByRow) {
  const Artifact a = artifact_of("fast", 0, often), b = artifact_of("slow", 5, never);
  const Comparison result = compare(a, b).value();
  EXPECT_EQ(result.pairs.size(), 20U);
  for (const RowPair& pair : result.pairs) EXPECT_EQ(evidence::pair_key(pair.a), evidence::pair_key(pair.b));
  ASSERT_EQ(result.groups.size(), 2U);
  const GroupComparison& stall = result.groups[1];
  EXPECT_EQ(stall.perturbation, "stall");
  EXPECT_EQ(stall.success.both, 2U);
  EXPECT_EQ(stall.success.only_b, 8U);
  EXPECT_NEAR(stall.success.p_value, 2.0 / 256, 1e-12);
  EXPECT_EQ(result.groups[0].success.p_value, 1);
  EXPECT_EQ(result.pooled.success.both, 12U);
  const MetricDifference& age = metric(result.pooled, "age_per_command.total.p95_ms");
  EXPECT_DOUBLE_EQ(age.difference.mean, 5);
  EXPECT_FALSE(age.difference.interval) << "the same 5 ms in every seed: no spread, and no certainty";
  EXPECT_EQ(age.difference.pairs, 20U);
  EXPECT_EQ(age.difference.seeds, 10U);
  EXPECT_EQ(age.b_better, 0);
  EXPECT_NEAR(age.p_value, 2.0 / 1024, 1e-12) << "ten seeds, not twenty pairs";
  EXPECT_TRUE(age.is_clear);
  EXPECT_EQ(metric(stall, "success").b_better, 0.9);
  // Failed rollouts never recovered: left out of that metric, and said so.
  EXPECT_EQ(metric(stall, "recovery_s").left_out, 8U);
  EXPECT_EQ(metric(stall, "recovery_s").difference.pairs, 2U);
  EXPECT_TRUE(result.notes.empty());
  const std::string text = comparison_text(result);
  EXPECT_NE(text.find("only A 0, only B 8, exact McNemar p = 0.00781"), std::string::npos) << text;
  const std::size_t shown = text.find("\n              age_per_command.total.p95_ms: A is better, ");
  EXPECT_LT(shown, text.find("\npanel ")) << "beside the verdict: " << text;
  const std::string of_stall = text.substr(text.find("\nreach, stall"));
  EXPECT_NE(of_stall.find("age_per_command.total.p95_ms"), std::string::npos) << of_stall;
  EXPECT_EQ(of_stall.find("recovery_s"), std::string::npos) << "no star: " << of_stall;
  EXPECT_EQ(to_json(result)["groups"][1]["success"]["only_b"], 8);
  EXPECT_EQ(comparison_html(result).find("<script"), std::string::npos);
  EXPECT_EQ(comparison_html(result).find("Fault classifier"), std::string::npos) << "no cause was planted";
}

// Ten successes of ten on both sides leave much open, and say so everywhere.
TEST_F(CompareTest, EqualSuccessIsNoCertainty) {
  const Artifact a = artifact_of("fast", 0, never), b = artifact_of("slow", 0, never);
  Comparison result = compare(a, b).value();
  for (const GroupComparison* table : {&result.pooled, &result.groups[0]}) {
    const Interval interval = metric(*table, "success").difference.interval.value();
    EXPECT_LT(interval.low, -0.3) << "ten seeds, whatever their conditions";
    EXPECT_GT(interval.high, 0.3);
  }
  for (const MetricDifference& each : result.pooled.metrics) EXPECT_FALSE(each.is_clear) << each.metric;
  EXPECT_EQ(margin_verdict(result, 0.02), MarginVerdict::undecided);
  EXPECT_EQ(margin_verdict(result, 0.5), MarginVerdict::non_inferior);
  EXPECT_EQ(pairs_to_decide(result, 0.02), 385U) << "1.96^2 / 0.02 seeds of two pairs";
  result.margin = SuccessMargin{.width = 0.02, .with_plan = true};
  const std::string text = comparison_text(result);
  EXPECT_NE(text.find("margin 2 %: B is undecided in success (-32 % to +32 %)\nplan: 385 pairs"), std::string::npos)
      << text;
  EXPECT_NE(text.find("success at any look: undecided, evidence 1 of 20"), std::string::npos) << text;
  EXPECT_TRUE(text.starts_with("verdict       no difference in success is shown: A 20 of 20, B 20 of 20, ")) << text;
  EXPECT_EQ(to_json(result)["margin"]["verdict"], "undecided");
  EXPECT_NE(comparison_html(result).find("B is undecided in success"), std::string::npos);
}

TEST_F(CompareTest, DecidesWhereSuccessDiffers) {
  const Artifact a = artifact_of("fast", 0, often), b = artifact_of("slow", 5, never);
  const Comparison better = compare(a, b).value(), worse = compare(b, a).value();
  EXPECT_EQ(margin_verdict(better, 0.02), MarginVerdict::superior);
  EXPECT_EQ(margin_verdict(worse, 0.02), MarginVerdict::inferior);
  EXPECT_EQ(better.pooled.success.seeds_for_b, 8U);
  EXPECT_NEAR(better.pooled.success.evidence, 12870.0 / 256, 1e-9);  // C(16, 8) / 2^8
  EXPECT_TRUE(comparison_text(better).starts_with("verdict       B succeeds more often: A 12 of 20, B 20 of 20, "))
      << comparison_text(better);
  EXPECT_TRUE(comparison_text(worse).starts_with("verdict       A succeeds more often: A 20 of 20, B 12 of 20, "));
  EXPECT_NE(comparison_text(better).find("at any look: B succeeds more often"), std::string::npos);
  EXPECT_NE(comparison_text(worse).find("at any look: A succeeds more often"), std::string::npos);
}

// The plan keeps its word: so many synthetic pairs of equal methods show non-inferiority in nine of ten panels.
TEST(ComparePlan, DecidesAsOftenAsItSays) {
  constexpr double kMargin = 0.1;
  Comparison seen;
  seen.pooled.success = {.both = 84, .only_a = 8, .only_b = 8, .effective_pairs = 100};
  const std::uint64_t pairs = pairs_to_decide(seen, kMargin);
  std::mt19937_64 random(20261127);
  std::map<std::pair<std::uint64_t, std::uint64_t>, bool> decided;
  int decisions = 0;
  constexpr int kPanels = 400;
  for (int panel = 0; panel < kPanels; ++panel) {
    std::vector<SeedSuccess> seeds(pairs, SeedSuccess{0, 0, 1});
    std::pair<std::uint64_t, std::uint64_t> found{0, 0};
    for (SeedSuccess& seed : seeds) {
      const std::uint64_t drawn = random() % 100;
      seed.only_a = drawn < 8 ? 1 : 0;
      seed.only_b = drawn >= 8 && drawn < 16 ? 1 : 0;
      found.first += seed.only_a;
      found.second += seed.only_b;
    }
    const auto [known, is_new] = decided.try_emplace(found, false);
    if (is_new) known->second = exact_rate_interval(seeds).low > -kMargin;
    decisions += known->second ? 1 : 0;
  }
  EXPECT_GT(decisions, kPanels * 0.86);
  EXPECT_LT(decisions, kPanels * 0.96);
}

TEST(CompareHtml, ShowsTheConfusionMatricesWhereBothSidesHaveOne) {
  evidence::RolloutRow planted = sample_row();
  planted.perturbation = "policy_freeze";
  planted.leading_fault = "unknown";
  Comparison comparison;
  comparison.a.method = "fast";
  comparison.b.method = "slow";
  comparison.a.confusion = confusions_of(std::array{planted}).begin()->second;
  EXPECT_EQ(comparison_html(comparison).find("Fault classifier"), std::string::npos) << "B has none";
  comparison.b.confusion = comparison.a.confusion;
  const std::string html = comparison_html(comparison);
  EXPECT_NE(html.find("<h3>A: fast</h3>"), std::string::npos) << html;
  EXPECT_NE(html.find("<h3>B: slow</h3>"), std::string::npos);
  EXPECT_NE(html.find("<th>planted</th><th>unknown</th><th>recall</th>"), std::string::npos) << html;
  EXPECT_NE(html.find("<td>inference_stall</td><td>1</td><td>0.000</td>"), std::string::npos) << html;
}

TEST_F(CompareTest, ComparesMethodsWithinOneArtifact) {
  const Artifact a = artifact_of("fast", 0, never), b = artifact_of("slow", 5, never);
  const std::vector<Artifact> both{a, b};
  const Artifact merged = merge(path("merged"), both).value();
  EXPECT_EQ(merged.rows.size(), 40U);
  EXPECT_EQ(merged.manifest.merged_from.size(), 2U);
  EXPECT_EQ(refusal(compare(merged, merged)),
            merged.folder.path() + " holds methods fast, slow; say which by --method-a");
  EXPECT_EQ(refusal(compare(merged, merged, "fast")),
            merged.folder.path() + " holds methods fast, slow; say which by --method-b");
  EXPECT_EQ(refusal(compare(merged, merged, "fast", "fest")),
            merged.folder.path() + " holds no method fest, only fast, slow");
  EXPECT_EQ(refusal(compare(merged, merged, "fast", "fast")), "both sides are method fast of " + merged.folder.path());
  const Comparison result = compare(merged, merged, "fast", "slow").value();
  EXPECT_EQ(to_json(result)["pooled"], to_json(compare(a, b).value())["pooled"]);
}

// Every mixture that the rule forbids, planted one at a time, for compare and for merge.
TEST_F(CompareTest, RefusesMixtures) {
  const Artifact a = artifact_of("fast", 0, never);
  const auto digits = [](const std::string& text) { return config::sha256_hex(text).substr(0, 12); };
  const auto expect_refused = [&](void (*change)(ArtifactManifest&, evidence::RolloutRow&), const std::string& what,
                                  const std::string& in_a, const std::string& in_b) {
    const Artifact b = artifact_of("slow", 0, never, change);
    EXPECT_EQ(refusal(compare(a, b)), "not comparable: the " + what + " differs: A has " + in_a + ", B has " + in_b);
    const std::vector<Artifact> both{a, b};
    const auto merged = merge(path("mixture"), both);
    EXPECT_EQ(merged ? "merged" : merged.error(), "refusing the mixture: the " + what + " differs: " + a.folder.path() +
                                                      " has " + in_a + ", " + b.folder.path() + " has " + in_b);
  };
  expect_refused([](ArtifactManifest& manifest, evidence::RolloutRow& row) { manifest.panel = row.panel = "other"; },
                 "panel", "smoke " + digits("panel"), "other " + digits("panel"));
  expect_refused([](ArtifactManifest& manifest,
                    evidence::RolloutRow& row) { manifest.script_version = row.script_version = "0.2.0"; },
                 "script", "takt 0.1.0 " + digits("sources"), "takt 0.2.0 " + digits("sources"));
  expect_refused([](ArtifactManifest& manifest, evidence::RolloutRow&) { manifest.seed_plan.rule = "as they come"; },
                 "seed plan", "20 seeds, \"seeds 1 to 20, the same for every method\"", "20 seeds, \"as they come\"");
  expect_refused(
      [](ArtifactManifest& manifest, evidence::RolloutRow& row) {
        manifest.plants["reach"] = row.plant_sha256 = config::sha256_hex("moon");
      },
      "plant of task reach", digits("plant"), digits("moon"));
}

TEST_F(CompareTest, MergeRefusesDoublesAndUnfinishedOnes) {
  const Artifact a = artifact_of("fast", 0, never), again = artifact_of("fast", 0, never);
  const auto merged = [&](const Artifact& other) {
    const std::vector<Artifact> both{a, other};
    const auto result = merge(path("merged"), both);
    return result ? "merged" : result.error();
  };
  EXPECT_EQ(merged(again), "refusing the mixture: rollout reach.none@0.fast.s1 is in " + a.folder.path() + " and in " +
                               again.folder.path());
  const Artifact tuned = artifact_of("fast", 0, never, [](ArtifactManifest& manifest, evidence::RolloutRow& row) {
    manifest.methods.at("fast").tasks.at(row.task).config_sha256 = row.config_sha256 = config::sha256_hex("tuned");
  });
  EXPECT_EQ(merged(tuned), "refusing the mixture: method fast has another configuration, policy or contract in " +
                               tuned.folder.path() + " than in " + a.folder.path());
  const Artifact open = write_artifact(path("open"), sample_manifest({"slow"}, 2), {sample_row("slow", 1)});
  EXPECT_EQ(merged(open), "refusing the mixture: " + open.folder.path() + " is unfinished");
  Artifact poorer = artifact_of("slow", 0, never);
  poorer.rows.pop_back();
  EXPECT_EQ(merged(poorer), "refusing the mixture: " + poorer.folder.path() + " holds 19 of 20 planned rollouts");
}

// Goal: a reader sees in what two methods differ, before any number. Method: what the panel file gives each of them.
TEST_F(CompareTest, SaysInWhatTheMethodsDiffer) {
  const Artifact a = artifact_of("fast", 0, never), b = artifact_of("slow", 0, never);
  PanelPromise promise;
  promise.methods = {{"fast", {{"policy.period", "20 ms"}, {"freshness.max_age", "1 s"}}},
                     {"slow", {{"policy.period", "40 ms"}, {"freshness.max_age", "1 s"}, {"link", "repeat_last"}}}};
  Comparison result = compare(a, b).value();
  name_configuration(a, b, promise, result);
  const std::string said =
      "configuration link: A as the robot file has it, B repeat_last\nconfiguration policy.period: A 20 ms, B 40 ms\n";
  EXPECT_NE(comparison_text(result).find(said), std::string::npos) << comparison_text(result);
  EXPECT_NE(comparison_rows_text(result).find(said), std::string::npos);
  EXPECT_EQ(to_json(result)["configuration"][1].dump(), R"({"key":"policy.period","a":"20 ms","b":"40 ms"})");
  EXPECT_NE(comparison_html(result).find("<tr><td>policy.period</td><td>20 ms</td><td>40 ms</td></tr>"),
            std::string::npos);
  EXPECT_TRUE(result.notes.empty());
  promise.methods["slow"] = promise.methods["fast"];
  name_configuration(a, b, promise, result);
  EXPECT_EQ(result.notes,
            std::vector<std::string>{"on reach the robot files of A and B differ, and panel.yaml does not say how"});
}

// Goal: another program of the same version and sources is seen. Method: one whose hash the manifest names.
TEST_F(CompareTest, NotesOtherBuildsOfTheSameSources) {
  Artifact a = artifact_of("fast", 0, never), b = artifact_of("slow", 0, never);
  EXPECT_TRUE(a.manifest.host.contains(kProgramHash));
  EXPECT_TRUE(compare(a, b)->notes.empty());
  b.manifest.host[kProgramHash] = std::string(64, 'b');
  const std::string own = a.manifest.host[kProgramHash].get<std::string>().substr(0, 12);
  EXPECT_EQ(compare(a, b)->notes, std::vector<std::string>{"A and B were computed by different builds of the same "
                                                           "sources: " +
                                                           own + " and bbbbbbbbbbbb"});
}

TEST_F(CompareTest, NotesWhatAReaderMustKnow) {
  const Artifact a = artifact_of("fast", 0, never);
  ArtifactManifest manifest = sample_manifest({"slow"}, 2);
  manifest.methods.at("slow").tasks.at("reach").max_age_ms = 60;
  const Artifact b = write_artifact(path("b"), manifest, {sample_row("slow", 3)});
  const Comparison result = compare(a, b).value();
  EXPECT_EQ(result.notes, (std::vector<std::string>{
                              "miss rates are not compared: on reach A's contract is Pr(age > 40 ms) <= 5 %, B's is "
                              "Pr(age > 60 ms) <= 5 %",
                              "B is unfinished: 1 of 2 planned rollouts", "19 rows of A have no partner"}));
  for (const MetricDifference& each : result.pooled.metrics) EXPECT_FALSE(each.metric.starts_with("misses"));
  EXPECT_EQ(result.pooled.metrics.size(), 19U);
  const Artifact c = write_artifact(path("c"), sample_manifest({"slow"}, 1), {sample_row("slow", 20)});
  EXPECT_EQ(refusal(compare(a, c)), "not comparable: no row of A has a partner in B");
}

}  // namespace
}  // namespace takt::lab
