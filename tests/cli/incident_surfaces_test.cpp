// SPDX-License-Identifier: Apache-2.0
// Goal: every surface tells the same sentence about a stop, and tells it first. Method: a virtual robot whose elbow
// grows too hot is recorded as takt-monitor does; what each surface would show is compared with the sentence that
// IncidentWatch makes of the same ticks. The same for a policy that falls silent and for a stop that the user asked
// for.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "cli/run/status_text.hpp"
#include "cli/top/live_view.hpp"
#include "cli/top/screen.hpp"
#include "evidence/review/report/report_html.hpp"
#include "evidence/review/report/report_text.hpp"
#include "evidence/review/run_review.hpp"
#include "lab/judge/post_mortem.hpp"
#include "monitor/telemetry/otlp_json.hpp"
#include "monitor/telemetry/prometheus_text.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

constexpr std::uint64_t kStrikesAt = 1'500, kTicks = 3'000;

struct Story {
  const char* what;
  void (*strike)(pipeline::TickInput& input);
  bool freezes_policy;
  const char* where;
  const char* words;  // in the sentence
  bool asked;
  friend void PrintTo(const Story& story, std::ostream* out) { *out << story.what; }
};

using test::text_of;

// Without spaces: lines lose those at their ends.
std::string squeezed(std::string text) {
  std::erase(text, ' ');
  return text;
}

class Surfaces : public test::TemporaryFolder, public testing::WithParamInterface<Story> {
 protected:
  Surfaces() {
    VirtualRobot robot;
    robot.spoil_input = [](pipeline::TickInput& input) {
      if (input.tick >= kStrikesAt && GetParam().strike != nullptr) GetParam().strike(input);
    };
    view.begin();
    metrics.begin("run");
    run = record(robot, path("run"), kTicks,
                 [&](std::uint64_t tick) { robot.policy_is_frozen = GetParam().freezes_policy && tick >= kStrikesAt; });
    const auto scanned = scan_run(
        run, {.tick = [&](const RecordedTick& tick) { take(tick.record); }, .command = {}, .keyframe = {}, .loss = {}});
    EXPECT_TRUE(scanned);
  }
  void take(const TickRecord& tick) {
    (void)watch.tick(tick);
    view.tick(tick);
    metrics.tick(tick);
    if (auto parts = diagnoser.tick(tick)) diagnostics = *parts;
    newest = tick.header.now;
  }
  [[nodiscard]] const incident::Incident& incident() const { return watch.latest().value(); }

  RecordedRun run{RunFolder(""), {}, {}};
  incident::IncidentWatch watch{demo_robot()};
  top::LiveView view{demo_robot()};
  LiveMetrics metrics{demo_robot()};
  Diagnoser diagnoser{demo_robot()};
  std::vector<Diagnostic> diagnostics;
  MonoTime newest;
};

TEST_P(Surfaces, TheSentenceNamesThePlaceAndTheFault) {
  ASSERT_TRUE(watch.latest());
  EXPECT_TRUE(watch.stands());
  EXPECT_EQ(incident().where, GetParam().where);
  EXPECT_NE(incident().sentence.find(GetParam().words), std::string::npos) << incident().sentence;
  EXPECT_EQ(incident().asked, GetParam().asked);
  EXPECT_GE(incident().tick, kStrikesAt);
}

TEST_P(Surfaces, TheReportBeginsWithIt) {
  const auto review = evidence::review_of(run);
  ASSERT_TRUE(review);
  const std::string text = evidence::report_text(review->metrics, run, 10);
  const std::size_t second_line = text.find('\n') + 1;
  const std::string line = text.substr(second_line, text.find('\n', second_line) - second_line);
  EXPECT_TRUE(line.starts_with(GetParam().asked ? "asked" : "STOPPED")) << line;
  EXPECT_TRUE(line.ends_with(incident().sentence)) << line;
  const std::string& counterfactual = review->metrics.incidents.front().counterfactual;
  EXPECT_EQ(counterfactual.empty(), !GetParam().freezes_policy) << counterfactual;
  EXPECT_NE(text.find(line + "\n" + (counterfactual.empty() ? "" : std::string(14, ' ') + counterfactual + "\n")),
            std::string::npos);
}

TEST_P(Surfaces, ThePageAndMetricsJsonHoldIt) {
  const auto written = write_metrics(run);
  ASSERT_TRUE(written);
  const auto json = nlohmann::json::parse(text_of(run.folder.metrics()));
  ASSERT_EQ(json.at("incidents").size(), 1U);
  EXPECT_EQ(json["incidents"][0]["sentence"], incident().sentence);
  EXPECT_EQ(json["incidents"][0]["asked"], GetParam().asked);
  EXPECT_EQ(json["incidents"][0]["chain"].back()["tick"], incident().tick);
  const auto review = evidence::review_of(run);
  const auto series = evidence::series_of(run, review->metrics, review->faults, "");
  ASSERT_TRUE(series) << series.error();
  const std::string page = evidence::report_html({run, review->metrics, review->faults, *series, std::nullopt});
  EXPECT_NE(page.find(incident().sentence.substr(0, 60)), std::string::npos);
  EXPECT_NE(page.find(review->metrics.incidents.front().counterfactual), std::string::npos);
  EXPECT_LT(page.find("id=\"incidents\""), page.find("id=\"verdicts\"")) << "it comes before what held";
}

TEST_P(Surfaces, TheRecordedTransitionsAndDiagnosticsTellIt) {
  EXPECT_NE(text_of(run.folder.transitions()).find(nlohmann::json(incident().sentence).dump()), std::string::npos);
  ASSERT_FALSE(diagnostics.empty());
  EXPECT_EQ(diagnostics.front().message, incident().sentence);
}

TEST_P(Surfaces, TopShowsItOnItsFirstScreen) {
  std::string screen;
  for (const top::Line& line : top::render(view.picture(newest), {}, {24, 100}, top::Glyphs::ascii)) {
    std::string row = line.text();
    screen += row.substr(std::min(row.size(), top::kLabel));
  }
  EXPECT_NE(squeezed(screen).find(squeezed(incident().sentence.substr(0, 160))), std::string::npos) << screen;
}

TEST_P(Surfaces, StatusSaysItInTextAndJson) {
  IncidentNote note;
  note.tick = incident().tick;
  note.stands = 1;
  incident().sentence.copy(note.sentence, sizeof note.sentence - 1);
  EXPECT_NE(cli::status_text({}, note).find(incident().sentence), std::string::npos);
  EXPECT_EQ(cli::status_json({}, note)["incident"]["sentence"], incident().sentence);
  EXPECT_EQ(cli::incident_sentence(note), incident().sentence);
  note.stands = 0;
  EXPECT_EQ(cli::incident_sentence(note), "");
}

TEST_P(Surfaces, PrometheusHasItsLabelsAndOpenTelemetryItsWords) {
  const std::string text = prometheus_text(metrics, demo_robot());
  const std::string where = incident().where.empty() ? "arm6" : incident().where;
  EXPECT_NE(text.find("takt_incident{robot=\"arm6\",mode=\"" + std::string(name(incident().to)) + "\",cause=\"" +
                      std::string(name(incident().cause)) + "\",where=\"" + where + "\",asked=\"" +
                      (incident().asked ? "yes" : "no") + "\"} 1\n"),
            std::string::npos);
  EXPECT_NE(text.find("cause=\"bus_off\"} 0\n"), std::string::npos) << "transitions are born at 0";
  const auto log = nlohmann::json::parse(otlp_logs({"arm6", "run", "ab", "1", 0}, std::span(&incident(), 1)));
  const auto& told = log["resourceLogs"][0]["scopeLogs"][0]["logRecords"][0];
  EXPECT_EQ(told["body"]["stringValue"], incident().sentence);
  EXPECT_EQ(told["severityNumber"], GetParam().asked ? 9 : 17);
}

TEST_P(Surfaces, ThePostMortemTellsItWithItsChain) {
  const evidence::RolloutRow row;
  lab::PostMortemDraft draft{.row = row, .verdicts = {}, .incidents = {incident()}};
  const std::string text = lab::post_mortem_text(draft);
  EXPECT_NE(text.find("- " + incident().sentence), std::string::npos);
  EXPECT_NE(text.find(incident().chain.front().what), std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(
    Incidents, Surfaces,
    testing::Values(Story{"over_temperature",
                          [](pipeline::TickInput& input) {
                            input.joints[2].error_code = 0xB;
                            input.joints[2].drive_state = DriveState::fault;
                          },
                          false, "joint elbow", "joint elbow: output stage over-temperature", false},
                    Story{"bus_down", [](pipeline::TickInput& input) { input.buses[1].state = BusState::down; }, false,
                          "bus can1", "bus can1: down or gone", false},
                    Story{"silent_policy", nullptr, true, "", "no usable command came", false},
                    Story{"operator_stop",
                          [](pipeline::TickInput& input) {
                            if (input.tick == kStrikesAt) input.operator_request = OperatorRequest::stop;
                          },
                          false, "", "a person asked for it", true}),
    [](const auto& story) { return std::string(story.param.what); });

// What stopped by itself comes before what was asked for, faults before stops.
TEST(ByGravity, TheWorstComesFirst) {
  std::vector<incident::Incident> all(3);
  all[0].asked = true;
  all[1].to = Mode::damped_stop;
  all[2].to = Mode::fault_latched;
  const auto sorted = by_gravity(all);
  EXPECT_EQ(sorted[0].to, Mode::fault_latched);
  EXPECT_EQ(sorted[1].to, Mode::damped_stop);
  EXPECT_TRUE(sorted[2].asked);
}

}  // namespace
}  // namespace takt::monitor
