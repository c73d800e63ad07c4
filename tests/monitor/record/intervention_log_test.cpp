// SPDX-License-Identifier: Apache-2.0
// Goal: who changed what on a robot PC can be told years later, and who alters, takes out or puts in a line is
// found by a stranger with a few lines of code. Method: starts, requests and deployments by several logs of one folder,
// at given instants; a second reading of the chain, written here; and each kind of edit.
#include "monitor/record/intervention_log.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "config/load.hpp"
#include "executive/ipc/descriptor.hpp"
#include "monitor/record/bounded_file.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

using Json = nlohmann::ordered_json;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kIn2026 = 1'790'000'000 * kSecond;  // September
constexpr std::int64_t kYear = 366 * 24 * 3600 * kSecond;

class InterventionLogTest : public test::TemporaryFolder {
 protected:
  InterventionLogTest() { std::filesystem::create_directory(folder_); }
  // The file's lines, their ends included.
  [[nodiscard]] std::vector<std::string> lines(const std::string& year = "2026") const {
    std::istringstream text(read_file(folder_ + "/" + year + ".jsonl").value_or(""));
    std::vector<std::string> found;
    for (std::string line; std::getline(text, line);) found.push_back(line + "\n");
    return found;
  }
  // The number of the first line that does not name the one before it; 0: all do.
  [[nodiscard]] static std::size_t broken_at(const std::vector<std::string>& lines) {
    for (std::size_t i = 1; i < lines.size(); ++i) {
      const Json json = Json::parse(lines[i], nullptr, false);
      if (!json.is_object() || json["before"] != config::sha256_hex(lines[i - 1])) return i;
    }
    return 0;
  }
  static OperatorWord word(OperatorVerb verb, bool done = true) {
    OperatorWord asked;
    asked.pid = ::getpid();
    asked.uid = 1000;
    asked.verb = verb;
    asked.done = done ? 1 : 0;
    std::string_view("takt").copy(asked.program, sizeof asked.program - 1);
    std::string_view("said so").copy(asked.answer, sizeof asked.answer - 1);
    return asked;
  }
  [[nodiscard]] RunManifest manifest(const std::string& resolved) const {
    RunManifest of;
    of.run_id = "run-7";
    of.executive_pid = ::getpid();
    of.executive_sha256 = "e";
    of.policy_sha256 = "p";
    of.config_sha256 = config::sha256_hex(resolved);
    of.watchdog_waivers = {{"elbow", "no drive of this kind has one"}};
    return of;
  }
  void start(InterventionLog& log, const std::string& resolved, std::int64_t at) {
    config::RobotConfig robot;
    robot.robot = "arm";
    robot.resolved = resolved;
    log.note_start(manifest(resolved), robot, at);
    EXPECT_EQ(log.failure(), "");
  }
  const std::string folder_ = path("interventions");
};

TEST_F(InterventionLogTest, SaysWhoAskedForWhatAndWhatAStartChanged) {
  InterventionLog log(folder_), another(folder_);
  const std::string first = "robot: arm\njoints:\n  - name: elbow\n    position: { max: 1.5 }\n";
  const std::string second = "robot: arm\njoints:\n  - name: elbow\n    position: { max: 2.5 }\n    limp: true\n";
  start(log, first, kIn2026);
  log.note(word(OperatorVerb::arm), "arm", kIn2026 + kSecond);
  log.note(word(OperatorVerb::mark), "arm", kIn2026 + kSecond);
  another.note(Deployment{"deploy", "old", "new", "arm", "c", "p", "proven: tracked for 30 s"}, kIn2026 + 2 * kSecond);
  start(log, second, kIn2026 + 3 * kSecond);
  log.note(word(OperatorVerb::stop, false), "arm", kIn2026 + 4 * kSecond);
  const auto all = lines();
  ASSERT_EQ(all.size(), 5U) << "a mark changes nothing";
  EXPECT_EQ(broken_at(all), 0U);
  const Json start_line = Json::parse(all[0]), arm = Json::parse(all[1]), deploy = Json::parse(all[2]),
             changed = Json::parse(all[3]), stop = Json::parse(all[4]);
  EXPECT_EQ(start_line["before"], "");
  EXPECT_EQ(start_line["what"], "start");
  EXPECT_EQ(start_line["run"], "run-7");
  EXPECT_EQ(start_line["waivers"][0]["reason"], "no drive of this kind has one");
  EXPECT_FALSE(start_line.contains("changed"));
  EXPECT_EQ(read_file(folder_ + "/robots/" + config::sha256_hex(first) + ".yaml"), first);
  EXPECT_EQ(arm["at"], utc_text(kIn2026 + kSecond));
  EXPECT_EQ(arm["what"], "arm");
  EXPECT_EQ(arm["who"]["uid"], 1000);
  EXPECT_EQ(arm["who"]["process"], "takt");
  EXPECT_EQ(arm["done"], true);
  EXPECT_EQ(deploy["deployment_before"], "old");
  EXPECT_EQ(deploy["who"]["uid"], ::getuid());
  EXPECT_EQ(deploy["config_sha256"], "c");
  EXPECT_EQ(deploy["policy_sha256"], "p");
  EXPECT_EQ(changed["config_sha256_before"], config::sha256_hex(first));
  EXPECT_EQ(changed["changed"], Json::parse(R"([{"key": "joints.elbow.limp", "before": "", "after": "true"},
                            {"key": "joints.elbow.position.max", "before": "1.5", "after": "2.5"}])"));
  EXPECT_EQ(stop["done"], false);
  EXPECT_EQ(stop["answer"], "said so");
}

// Threat: log-edited
TEST_F(InterventionLogTest, AnEditShows) {
  InterventionLog log(folder_);
  for (int i = 0; i < 5; ++i)
    log.note(word(i % 2 == 0 ? OperatorVerb::arm : OperatorVerb::stop), "arm", kIn2026 + i * kSecond);
  const auto whole = lines();
  ASSERT_EQ(broken_at(whole), 0U);
  auto altered = whole;
  altered[2].replace(altered[2].find("\"uid\":1000"), 10, "\"uid\":1001");
  EXPECT_EQ(broken_at(altered), 3U);
  auto taken_out = whole;
  taken_out.erase(taken_out.begin() + 1);
  EXPECT_EQ(broken_at(taken_out), 1U);
  auto put_in = whole;
  put_in.insert(put_in.begin() + 3, whole[2]);
  EXPECT_EQ(broken_at(put_in), 3U);
}

TEST_F(InterventionLogTest, TheChainGoesOnOverAYearAndWhatIsOldGoes) {
  InterventionLog log(folder_);
  for (int year = 0; year < 8; ++year)
    log.note(word(year % 2 == 0 ? OperatorVerb::reset : OperatorVerb::arm), "arm", kIn2026 + year * kYear);
  std::set<std::string> kept;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) kept.insert(entry.path().filename());
  EXPECT_THAT(kept, ElementsAre("2028.jsonl", "2029.jsonl", "2030.jsonl", "2031.jsonl", "2032.jsonl", "2033.jsonl"));
  EXPECT_EQ(Json::parse(lines("2033")[0])["before"], config::sha256_hex(lines("2032")[0]));
}

// Goal: a computer whose clock is wrong keeps its log, and the chain holds. Method: a line of 1970, as after an empty
// battery, and one of 2090, among those of 2026.
TEST_F(InterventionLogTest, AWrongClockCostsNoLine) {
  InterventionLog log(folder_);
  log.note(word(OperatorVerb::arm), "arm", kIn2026);
  log.note(word(OperatorVerb::stop), "arm", kSecond);
  log.note(word(OperatorVerb::reset), "arm", kIn2026 + kSecond);
  log.note(word(OperatorVerb::arm), "arm", kIn2026 + 64 * kYear);
  log.note(word(OperatorVerb::stop), "arm", kIn2026 + 2 * kSecond);
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/1970.jsonl"));
  auto all = lines("2026");
  EXPECT_EQ(all.size(), 3U);
  EXPECT_EQ(Json::parse(all[1])["at"], "1970-01-01T00:00:01.000Z");
  for (const std::string& line : lines("2090")) all.push_back(line);
  EXPECT_EQ(all.size(), 5U);
  EXPECT_EQ(broken_at(all), 0U);
}

// A power cut in the middle of a line.
TEST_F(InterventionLogTest, ATornLineStaysALineOfItsOwn) {
  InterventionLog log(folder_);
  log.note(word(OperatorVerb::arm), "arm", kIn2026);
  std::ofstream(folder_ + "/2026.jsonl", std::ios::app) << R"({"at":"20)";
  log.note(word(OperatorVerb::stop), "arm", kIn2026 + kSecond);
  const auto all = lines();
  ASSERT_EQ(all.size(), 3U);
  EXPECT_EQ(Json::parse(all[2])["before"], config::sha256_hex(all[1]));
}

// Goal: what a program asks for without end fills no disk, and the log says that it left something out.
TEST_F(InterventionLogTest, AFloodIsBounded) {
  InterventionLog log(folder_);
  for (int i = 0; i < 1000; ++i)
    log.note(word(i % 2 == 0 ? OperatorVerb::stop : OperatorVerb::arm), "arm", kIn2026 + i);
  EXPECT_EQ(lines().size(), InterventionLog::kMostAtOnce);
  EXPECT_EQ(log.failure(), "");
}

// Goal: `takt run --arm`, which asks until it is granted, costs no line of what comes behind it. Method: a refusal that
// is repeated more often than lines may be written, then the arming that is granted.
TEST_F(InterventionLogTest, WhatIsAskedAgainAndAgainIsOneLine) {
  InterventionLog log(folder_);
  for (int i = 0; i < 1000; ++i) log.note(word(OperatorVerb::arm, false), "arm", kIn2026 + i);
  log.note(word(OperatorVerb::arm), "arm", kIn2026 + kSecond);
  log.note(word(OperatorVerb::stop), "arm", kIn2026 + 2 * kSecond);
  const auto all = lines();
  ASSERT_EQ(all.size(), 3U);
  EXPECT_EQ(Json::parse(all[1])["done"], true);
  EXPECT_EQ(Json::parse(all[1])["repeated"], 999);
  EXPECT_FALSE(Json::parse(all[2]).contains("repeated"));
}

// Goal: a full disk leaves no half of a line. Method: a limit on the size of files, in the middle of the second line.
TEST_F(InterventionLogTest, AFullDiskLeavesNoHalfOfALine) {
  InterventionLog log(folder_);
  log.note(word(OperatorVerb::arm), "arm", kIn2026);
  const auto whole = lines();
  ASSERT_EQ(whole.size(), 1U);
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit small{whole[0].size() + 40, before.rlim_max};
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  log.note(word(OperatorVerb::stop), "arm", kIn2026 + kSecond);
  ::setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_THAT(log.failure(), HasSubstr("2026.jsonl: "));
  EXPECT_EQ(read_file(folder_ + "/2026.jsonl"), whole[0]);
  log.note(word(OperatorVerb::reset), "arm", kIn2026 + 2 * kSecond);
  EXPECT_EQ(lines().size(), 2U);
  EXPECT_EQ(broken_at(lines()), 0U);
}

TEST_F(InterventionLogTest, WithoutAFolderThereIsNone) {
  InterventionLog log(path("nowhere"));
  log.note(word(OperatorVerb::arm), "arm", kIn2026);
  EXPECT_FALSE(log.is_kept());
  EXPECT_EQ(log.failure(), "");
  EXPECT_FALSE(std::filesystem::exists(path("nowhere")));
}

// Goal: what cannot be written is said, and costs the recorder little. Method: a link in the place of the year, a lock
// that another process holds, a folder of no one's.
TEST_F(InterventionLogTest, WhatCannotBeWrittenIsSaid) {
  InterventionLog log(folder_);
  std::filesystem::create_symlink(path("elsewhere"), folder_ + "/2026.jsonl");
  log.note(word(OperatorVerb::arm), "arm", kIn2026);
  EXPECT_THAT(log.failure(), HasSubstr("2026.jsonl: Too many levels of symbolic links"));
  EXPECT_FALSE(std::filesystem::exists(path("elsewhere")));
  std::filesystem::remove(folder_ + "/2026.jsonl");
  {
    const ipc::Descriptor held(::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    ASSERT_EQ(::flock(held.get(), LOCK_EX), 0);
    log.note(word(OperatorVerb::arm), "arm", kIn2026);
    EXPECT_THAT(log.failure(), HasSubstr("another process holds its lock"));
  }
  log.note(word(OperatorVerb::arm), "arm", kIn2026);
  EXPECT_EQ(log.failure(), "");
  EXPECT_EQ(lines().size(), 1U);
}

TEST(InterventionFolder, IsBesideTheRuns) {
  EXPECT_EQ(intervention_folder("/var/lib/takt/runs"), "/var/lib/takt/interventions");
  EXPECT_EQ(intervention_folder("/var/lib/takt/runs/"), "/var/lib/takt/interventions");
  EXPECT_EQ(intervention_folder("/srv/../data/runs"), "/data/interventions");
}

TEST(ChangedKeys, AreThoseOfTheFilesOnly) {
  EXPECT_THAT(changed_keys("a: 1\nb: [1, 2]\n", "a: 1\nb: [1, 3]\nc: { d: x }\n"),
              ElementsAre(ChangedKey{"b.1", "2", "3"}, ChangedKey{"c.d", "", "x"}));
  EXPECT_TRUE(changed_keys("a: 1\n", "&x").empty()) << "no robot file";
}

}  // namespace
}  // namespace takt::monitor
