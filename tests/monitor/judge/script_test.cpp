// SPDX-License-Identifier: Apache-2.0
// Goal: a stop that the script brought about is asked for and names the process that is gone; no other stop is. Method:
// the recorded demo, whose policy falls silent and is lost, with events.jsonl written beside it by hand.
#include "monitor/judge/script.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "evidence/review/report/report_text.hpp"
#include "evidence/review/run_review.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

constexpr const char* kHint = "the policy host's log says";

class ScriptTest : public test::TemporaryFolder {
 protected:
  ScriptTest() { std::filesystem::remove(run_.folder.seal()); }

  struct Line {
    Duration before;  // the stop
    std::string rest;
  };
  // Events at their instants before the demo's only stop.
  void write(const std::vector<Line>& lines) const {
    std::ofstream file(events_, std::ios::trunc);
    for (const Line& line : lines)
      file << fmt::format("{{\"monotonic_ns\":{},\"utc\":\"\",{}}}\n", (stopped_ - line.before).ns, line.rest);
  }
  RunMetrics with(const std::vector<Line>& lines) const {
    write(lines);
    return *metrics_of(run_);
  }
  bool is_asked_with(const std::vector<Line>& lines) const { return with(lines).incidents.at(0).asked; }
  static std::string script(const std::string& action, const std::string& process, Duration length = {}) {
    return fmt::format(R"("event":"script","given":"--at '3 s: {0}'","action":"{0}","process":"{1}","length_ns":{2})",
                       action, process, length.ns);
  }
  static std::string ended(const std::string& process) {
    return fmt::format(R"("event":"ended","process":"{}","how":"was killed by SIGKILL")", process);
  }

  const RecordedRun run_ = record_demo(path("run"));
  const std::string events_ = run_.folder.path() + "/events.jsonl";
  const MonoTime stopped_ = metrics_of(run_)->incidents.at(0).at;
};

TEST_F(ScriptTest, AKilledPolicyIsNamedAndAskedFor) {
  write({{milliseconds(700), script("kill", "takt-policy-host")}, {milliseconds(699), ended("takt-policy-host")}});
  const evidence::RunReview review = *evidence::review_of(run_);
  ASSERT_EQ(review.metrics.incidents.size(), 1U);
  const incident::Incident& incident = review.metrics.incidents[0];
  const std::string known = "; takt-policy-host was killed by SIGKILL, 699 ms before; scripted: --at '3 s: kill', ";
  EXPECT_TRUE(incident.asked);
  EXPECT_EQ(incident.sentence.find("stop asked for at tick "), 0U) << incident.sentence;
  EXPECT_NE(incident.sentence.find(known + "700 ms before;"), std::string::npos) << incident.sentence;
  EXPECT_EQ(incident.sentence.find(kHint), std::string::npos) << incident.sentence;
  const StopOrigin& origin = review.metrics.stop_origins.at(incident.tick);
  EXPECT_EQ(origin.scripted, "--at '3 s: kill', 700 ms before");
  EXPECT_EQ(origin.ended, "takt-policy-host was killed by SIGKILL, 699 ms before");
  const nlohmann::ordered_json json = to_json(review.metrics, run_)["incidents"][0];
  EXPECT_EQ(json.at("asked"), true);
  EXPECT_EQ(json.at("ended_process"), "takt-policy-host was killed by SIGKILL, 699 ms before");
  // The loss that led to it too; the stall of 1 s before does not.
  ASSERT_EQ(review.faults.verdicts.size(), 2U);
  EXPECT_NE(review.faults.verdicts[0].sentence.find(kHint), std::string::npos) << review.faults.verdicts[0].sentence;
  EXPECT_NE(review.faults.verdicts[1].sentence.find("; takt-policy-host was killed by SIGKILL"), std::string::npos)
      << review.faults.verdicts[1].sentence;
}

TEST_F(ScriptTest, WhatDiedByItselfIsNamedAndNotAskedFor) {
  const incident::Incident incident = with({{milliseconds(700), ended("takt-policy-host")}}).incidents.at(0);
  EXPECT_FALSE(incident.asked);
  EXPECT_EQ(incident.sentence.find("stop at tick "), 0U) << incident.sentence;
  EXPECT_NE(incident.sentence.find("; takt-policy-host was killed by SIGKILL, 700 ms before;"), std::string::npos);
  EXPECT_EQ(incident.sentence.find(kHint), std::string::npos) << incident.sentence;
}

TEST_F(ScriptTest, WhatEndsByItselfExplainsAStopThatFollowsSoon) {
  for (const char* action : {"freeze", "hog", "fault"}) {
    EXPECT_TRUE(is_asked_with({{seconds(1), script(action, "takt-policy-host", milliseconds(400))}})) << action;
    EXPECT_FALSE(is_asked_with({{seconds(3), script(action, "takt-policy-host", milliseconds(400))}})) << action;
  }
}

TEST_F(ScriptTest, WhatCannotHaveDoneItExplainsNothing) {
  const std::vector<std::vector<Line>> cases{
      {},
      {{milliseconds(700), script("kill", "takt-monitor")}, {milliseconds(699), ended("takt-monitor")}},
      {{milliseconds(700), script("kill", "takt-plant")}},
      {{milliseconds(700), script("arm", "takt-executive")}},
      {{milliseconds(-1), script("kill", "takt-policy-host")}},
      {{seconds(3), script("kill", "takt-policy-host")},
       {milliseconds(2'999), ended("takt-policy-host")},
       {milliseconds(2'900), R"("event":"started","process":"takt-policy-host")"}}};
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const RunMetrics metrics = with(cases[i]);
    EXPECT_FALSE(metrics.incidents.at(0).asked) << i;
    EXPECT_NE(metrics.incidents[0].sentence.find(kHint), std::string::npos) << i;
    EXPECT_TRUE(metrics.stop_origins.empty()) << i;
  }
}

// A line that was added to a closed run makes no stop one that was asked for.
TEST_F(ScriptTest, WhatIsNotSealedExplainsNothing) {
  const std::vector<Line> kill{{milliseconds(700), script("kill", "takt-policy-host")}};
  ASSERT_TRUE(is_asked_with(kill));
  record_demo(path("sealed"));
  std::filesystem::copy(path("sealed") + "/seal.json", run_.folder.seal());
  EXPECT_FALSE(is_asked_with(kill));
}

// Goal: what the policy's host said kept it from answering stands in the place of the hint where to look, unless it was
// over by then; a process that ended says more than its host could.
TEST_F(ScriptTest, WhatThePolicysHostSaysIsTheReason) {
  const auto said = [](const std::string& what, const std::string& role = "policy") {
    return fmt::format(R"("event":"policy","role":"{}","kind":"problem","what":"{}")", role, what);
  };
  const RunMetrics metrics = with({{milliseconds(450), said("policy server far has no policy")}});
  const incident::Incident& incident = metrics.incidents.at(0);
  EXPECT_NE(incident.sentence.find("; policy: policy server far has no policy, 450 ms before;"), std::string::npos)
      << incident.sentence;
  EXPECT_EQ(incident.sentence.find(kHint), std::string::npos) << incident.sentence;
  EXPECT_FALSE(incident.asked);
  EXPECT_EQ(to_json(metrics, run_)["incidents"][0].at("policy_said"),
            "policy: policy server far has no policy, 450 ms before");
  for (const std::vector<Line>& other :
       {std::vector<Line>{{milliseconds(450), said("no sensor")}, {milliseconds(440), said("")}},
        std::vector<Line>{{milliseconds(450), said("no sensor", "candidate policy")}},
        std::vector<Line>{{milliseconds(-900), said("no sensor")}}})
    EXPECT_NE(with(other).incidents.at(0).sentence.find(kHint), std::string::npos);
  const incident::Incident killed =
      with({{milliseconds(700), said("its host left")}, {milliseconds(699), ended("takt-policy-host")}})
          .incidents.at(0);
  EXPECT_NE(killed.sentence.find("; takt-policy-host was killed by SIGKILL, 699 ms before;"), std::string::npos)
      << killed.sentence;
  EXPECT_EQ(killed.sentence.find("its host left"), std::string::npos) << killed.sentence;
}

// Goal: a policy that waits for a sensor is explained by that sensor's program, as long as that is gone.
TEST_F(ScriptTest, TheEndOfASensorsProgramStandsBesideThePolicysProblem) {
  const Line problem{milliseconds(450),
                     R"("event":"policy","role":"policy","kind":"problem","what":"sensor cam0: no sample yet")"};
  const std::string told =
      "; policy: sensor cam0: no sample yet, 450 ms before; sensor-cam0 was killed by SIGKILL, 500 ms before";
  const auto sentence = [&](std::vector<Line> lines) {
    lines.push_back(problem);
    return with(lines).incidents.at(0).sentence;
  };
  EXPECT_NE(sentence({{milliseconds(500), ended("sensor-cam0")}}).find(told), std::string::npos);
  EXPECT_EQ(sentence({{milliseconds(500), ended("sensor-cam1")}}).find("SIGKILL"), std::string::npos);
  EXPECT_EQ(sentence({{milliseconds(500), ended("sensor-cam")}}).find("SIGKILL"), std::string::npos);
  EXPECT_EQ(sentence({{milliseconds(500), ended("sensor-cam0")},
                      {milliseconds(480), R"("event":"started","process":"sensor-cam0")"}})
                .find("SIGKILL"),
            std::string::npos);
}

// Goal: the report and metrics.json say which other process made the commands, and from which on.
TEST_F(ScriptTest, WhoseCommandsTheyWereIsTold) {
  const auto source = [](const std::string& what, int first) {
    return fmt::format(R"("event":"policy","role":"policy","kind":"source","what":"{}","first_sequence":{})", what,
                       first);
  };
  const RunMetrics metrics = with(
      {{milliseconds(900), source("policy server far", 1)}, {milliseconds(800), source("policy server near", 41)}});
  ASSERT_EQ(metrics.command_sources.size(), 2U);
  EXPECT_EQ(metrics.command_sources[1].what, "policy server near");
  EXPECT_EQ(to_json(metrics, run_)["command_sources"][1].at("first_sequence"), 41);
  const std::string text = evidence::report_text(metrics, run_);
  EXPECT_NE(text.find("policy: from command 41 on of policy server near"), std::string::npos) << text;
}

TEST_F(ScriptTest, APlantsFaultHoldsUntilItsEnd) {
  const auto fault = [](const std::string& what) {
    return fmt::format(R"("event":"fault","given":"faults.yaml","what":"{}")", what);
  };
  const RunMetrics metrics = with({{milliseconds(700), fault("camera: freeze for 9 s")}});
  EXPECT_EQ(metrics.stop_origins.at(metrics.incidents.at(0).tick).scripted,
            "faults.yaml: camera: freeze for 9 s, 700 ms before");
  EXPECT_FALSE(is_asked_with({{seconds(3), fault("camera: freeze for 1 ms")},
                              {milliseconds(2'999), fault("camera: end of freeze for 1 ms")}}));
}

}  // namespace
}  // namespace takt::monitor
