// SPDX-License-Identifier: Apache-2.0
// Goal: the `takt` program does what its help says and ends with the documented exit codes. Method: the real binary, in
// a directory of its own; `takt run` with the real processes of the demo robot, after which nothing may be left
// running.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <thread>
#include <utility>

#include "config/read_all.hpp"
#include "tests/cli/shell.hpp"
#include "tests/process/patient_copy.hpp"
#include "tests/support/files.hpp"
#include "tests/support/shared_files.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;

using takt::test::text_of;
using test::Ended;

// Bounded wait for what other processes do.
bool poll_until(const auto& holds) {
  for (int poll = 0; poll < 1500 && !holds(); ++poll) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  return holds();
}

// A program of ours that runs while this lives.
class Background {
 public:
  Background(const std::string& command, const std::string& log, const std::string& environment = {}) : pid_(fork()) {
    if (pid_ != 0) return;
    const std::string line = environment + "exec " + std::string(TAKT_BIN_DIR) + "/" + command + " >" + log + " 2>&1";
    execl("/bin/sh", "sh", "-c", line.c_str(), nullptr);
    _exit(127);
  }
  ~Background() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  Background(const Background&) = delete;
  Background& operator=(const Background&) = delete;

  // Its exit code, -1 of a signal.
  int interrupt() {
    int status = 0;
    kill(pid_, SIGINT);
    waitpid(std::exchange(pid_, -1), &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  pid_t pid_;
};

class Cli : public test::Shell {
 protected:
  static std::string takt() { return std::string(TAKT_BIN_DIR) + "/takt "; }
  static Ended run(const std::string& arguments) { return Shell::takt(arguments); }
  [[nodiscard]] std::string run_arguments(const std::string& more) const {
    return "run " + robot_ + " --allow-non-realtime --runtime-dir " + directory() + " --run-dir " + in("run") + " " +
           more;
  }
  const std::string robot_ = ::takt::test::patient_copy("config/arm6.yaml", directory());
  // Processes whose command line names this test's directory.
  [[nodiscard]] int left_running() const {
    int count = 0;
    for (const auto& entry : fs::directory_iterator("/proc")) {
      std::ifstream file(entry.path() / "cmdline");
      const std::string line = config::read_all(file).value_or("");  // of one that ends meanwhile: nothing
      if (line.find(directory()) != std::string::npos && line.find("takt") != std::string::npos) ++count;
    }
    return count;
  }
};

TEST_F(Cli, HelpOfEveryCommandHasAnExampleAndItsExitCodes) {
  for (const char* command :
       {"run",    "arm",          "stop",        "reset",       "mark",       "command",       "gamepad",
        "status", "top",          "report",      "replay",      "budget",     "margin",        "ablate",
        "ages",   "config check", "config show", "config keys", "config new", "config import", "doctor",
        "deploy", "rollback",     "bus up",      "bus disable", "runs list",  "runs keep",     "runs prune"}) {
    const Ended help = run(std::string(command) + " --help");
    EXPECT_EQ(help.exit_code, 0) << command;
    const bool has_example = help.output.find("Example: takt ") != std::string::npos ||
                             help.output.find("Example: sudo takt ") != std::string::npos;
    EXPECT_TRUE(has_example) << command << "\n" << help.output;
    EXPECT_NE(help.output.find("Exit codes:"), std::string::npos) << command;
  }
  EXPECT_EQ(run("--version").output.find("takt "), 0U);
}

TEST_F(Cli, WrongCommandLinesEndWith64) {
  EXPECT_EQ(run("").exit_code, 64);
  EXPECT_EQ(run("fly").exit_code, 64);
  const auto says = [](const char* words) {
    const Ended ended = run(words);
    EXPECT_EQ(ended.exit_code, 64) << words;
    return ended.output;
  };
  EXPECT_EQ(says("stauts"),
            "takt: there is no command `takt stauts`; did you mean `takt status`? `takt help` lists them\n");
  EXPECT_EQ(says("config chek x.yaml"),
            "takt: there is no command `takt config chek`; did you mean `takt config check`? `takt help config` lists "
            "them\n");
  EXPECT_EQ(says("run config/arm6.yaml --duratoin 3s"),
            "takt: `takt run` has no option --duratoin; did you mean `--duration`? `takt help run` lists them\n");
  EXPECT_EQ(
      says("status --runtime-dri=/x"),
      "takt: `takt status` has no option --runtime-dri; did you mean `--runtime-dir`? `takt help status` lists them\n");
  EXPECT_EQ(says("help stauts"), says("stauts"));
  EXPECT_EQ(
      says("calibrate x.yaml"),
      "takt: there is no command `takt calibrate`; did you mean `takt policy calibrate`? `takt help` lists them\n")
      << "a group left out";
  EXPECT_EQ(says("config/arm6.yaml"),
            "takt: there is no command `takt config/arm6.yaml`; did you mean `takt run config/arm6.yaml`? `takt help` "
            "lists them\n");
  EXPECT_EQ(says("xyzzyxyzzy"), "takt: there is no command `takt xyzzyxyzzy`; `takt help` lists them\n");
  EXPECT_EQ(run(run_arguments("--at 'soon: stop'")).exit_code, 64);
  EXPECT_EQ(run(run_arguments("--duration 20")).exit_code, 64);
}

// Goal: a run goes when the robot file says so, and not before. Method: a run of 2023 by an earlier version,
// beside what is no run; listed, kept, and pruned by robot files that keep all, thirty days, and thirty days after all.
TEST_F(Cli, RunsAreListedKeptAndPruned) {
  const std::string runs = in("runs"), old = runs + "/old";
  fs::create_directories(runs + "/no run");
  fs::copy("tests/releases/0.2.0/run", old, fs::copy_options::recursive);
  std::ofstream(old + "/metrics.json") << R"({"incident_count": 0, "incidents": [], "mark_count": 0})";
  const Ended listed = run("runs list " + runs);
  EXPECT_EQ(listed.exit_code, 0);
  EXPECT_EQ(listed.output.find("old  20"), 0U) << listed.output;
  EXPECT_NE(listed.output.find("\n1 runs, 0.0 GiB in " + runs + "\n"), std::string::npos) << listed.output;
  const std::string robot = ::takt::test::patient_copy("config/arm6.yaml", directory(), {{"record.directory", runs}});
  EXPECT_EQ(run("runs list " + robot).output, listed.output);
  const Ended keeps_all = run("runs prune " + robot);
  EXPECT_EQ(keeps_all.exit_code, 64);
  EXPECT_NE(keeps_all.output.find("keeps every run; write record.keep"), std::string::npos) << keeps_all.output;
  (void)::takt::test::patient_copy("config/arm6.yaml", directory(),
                                   {{"record.directory", runs}, {"record.keep.days", "30"}});
  EXPECT_EQ(run("runs keep " + old).exit_code, 0);
  EXPECT_NE(run("runs list " + runs).output.find("kept; "), std::string::npos);
  EXPECT_EQ(run("runs prune " + robot).output, "0 runs deleted, 0.0 GiB\n");
  fs::remove(old + "/kept");
  EXPECT_EQ(run("runs prune " + robot).output, "deleted " + old + "\n1 runs deleted, 0.0 GiB\n");
  EXPECT_FALSE(fs::exists(old));
  EXPECT_TRUE(fs::exists(runs + "/no run"));
  EXPECT_EQ(run("runs keep " + old).exit_code, 1);
}

// Whether it fits into a buffer or not.
TEST_F(Cli, OutputThatAFullDiskDidNotTakeIsAFailure) {
  for (const char* command :
       {"config show config/arm6.yaml", "policy check config/arm6_reach.onnx --json", "--version"}) {
    const Ended ended = shell("(" + std::string(TAKT_BIN_DIR) + "/takt " + command + " >/dev/full)");
    EXPECT_EQ(ended.exit_code, 1) << command;
    EXPECT_EQ(ended.output, "takt: its output could not be written; is the disk full?\n") << command;
  }
}

TEST_F(Cli, HelpIsAWordToo) {
  EXPECT_EQ(run("help").output, run("--help").output);
  EXPECT_EQ(run("help run").output, run("run --help").output);
  EXPECT_EQ(run("help config check").output, run("config check --help").output);
  EXPECT_EQ(run("help config check").exit_code, 0);
  EXPECT_NE(run("help").output.find("  help "), std::string::npos) << "it lists itself";
}

// Numbers alone are in the option's unit, which the help names; with a unit they are written as in robot files.
TEST_F(Cli, QuantitiesAreWrittenAsInRobotFiles) {
  EXPECT_EQ(run("doctor --for 10ms --json").output.find("is not a time"), std::string::npos);
  const Ended wrong = run("doctor --for 10deg");
  EXPECT_EQ(wrong.exit_code, 64);
  EXPECT_NE(wrong.output.find("10deg is an angle, not a time; write it in ns or us or ms or s or min or h"),
            std::string::npos)
      << wrong.output;
  EXPECT_EQ(run("bus disable --robot no-such-robot.yaml --seconds 61s").exit_code, 64) << "at most a minute";
  EXPECT_EQ(run("bus disable --robot no-such-robot.yaml --seconds 61ms").exit_code, 65);
  EXPECT_EQ(run("joint jog elbow --robot no-such-robot.yaml --by -0.1rad --speed 0.2rad/s --torque 1Nm").exit_code, 65);
  EXPECT_EQ(run("joint jog elbow --robot no-such-robot.yaml --speed 2rad/s").exit_code, 64) << "90 deg/s at most";
  EXPECT_NE(run("joint jog --help").output.find("--by deg"), std::string::npos);
}

TEST_F(Cli, ConfigCheckNamesProblemsAndEndsWith65) {
  EXPECT_EQ(run("config check config/arm6.yaml").exit_code, 0);
  std::ofstream(in("bad.yaml")) << "schema: takt.robot/1\nrobot: x\nrobot: y\n";
  const Ended text = run("config check " + in("bad.yaml"));
  EXPECT_EQ(text.exit_code, 65);
  EXPECT_EQ(text.output,
            in("bad.yaml") + ":3:1: duplicate key `robot`, first written in line 2; keep one of the two\n");
  const Ended json = run("config check --json " + in("bad.yaml"));
  EXPECT_EQ(json.exit_code, 65);
  EXPECT_EQ(nlohmann::json::parse(json.output)["problems"].size(), 1U);
}

// Goal: what a process would refuse at its start is said before anything is started. Method: the demo robot with one
// fault each: an observation one value too wide, a model that is not there, a link that branches off; a host
// of one's own judges its policy itself.
// The shorter of two: degraded.after, and more than epsilon of the window at one go.
TEST_F(Cli, ConfigCheckSaysWhichSilenceDegradesTheRobot) {
  const auto says = [](const std::string& robot, const std::string& silence) {
    const std::string output = run("config check " + robot).output;
    EXPECT_NE(output.find("a silence of " + silence + " beyond max_age"), std::string::npos) << output;
  };
  says(robot_, "11 ms");
  for (const auto& [after, silence] : {std::pair{"5 ms", "5 ms"}, std::pair{"40 ms", "11 ms"}})
    says(::takt::test::patient_copy("config/arm6.yaml", directory(), {{"degraded.after", after}}), silence);
  const std::string short_chunks =
      ::takt::test::patient_copy("config/arm6.yaml", directory(), {{"freshness.max_age", "200 ms"}});
  const std::string output = run("config check " + short_chunks).output;
  EXPECT_NE(output.find("a silence of 11 ms beyond the chunk's end at 160 ms (max_age 200 ms)"), std::string::npos)
      << output;
}

TEST_F(Cli, ConfigCheckRefusesWhatHostAndPlantWould) {
  const auto checked = [&](const std::string& from, const std::string& to, const std::string& more = "") {
    std::string text = text_of("config/arm6.yaml");
    const auto replace = [&text](const std::string& one, const std::string& other) {
      EXPECT_NE(text.find(one), std::string::npos) << one;
      text.replace(text.find(one), one.size(), other);
    };
    replace("file: arm6_reach.onnx", "file: " + fs::absolute("config/arm6_reach.onnx").string());
    replace(from, to);
    std::ofstream(in("robot.yaml")) << text;
    return run("config check " + in("robot.yaml") + more);
  };
  const std::string terms = "    - { term:", wider = "    - { term: constant, values: [1] }\n" + terms;
  EXPECT_EQ(checked(terms, terms).exit_code, 0);
  const Ended wide = checked(terms, wider);
  EXPECT_EQ(wide.exit_code, 65);
  EXPECT_NE(wide.output.find("the configuration's terms give"), std::string::npos) << wide.output;
  EXPECT_EQ(checked(terms, wider, " --policy-host mine").exit_code, 0);
  const Ended absent = checked("simulation:\n", "simulation:\n  mujoco: { model: nowhere.xml }\n");
  EXPECT_EQ(absent.exit_code, 65);
  EXPECT_NE(absent.output.find("simulation"), std::string::npos) << absent.output;
  const Ended tree = checked("parent: wrist_roll,", "parent: shoulder,");
  EXPECT_EQ(tree.exit_code, 65);
  EXPECT_NE(tree.output.find("link "), std::string::npos) << tree.output;
}

TEST_F(Cli, OfManyProblemsTenAreTold) {
  const auto lines = [](const Ended& ended) { return std::ranges::count(ended.output, '\n'); };
  std::ofstream file(in("bad.yaml"));
  file << "schema: takt.robot/1\n";
  for (int key = 0; key < 25; ++key) file << "unknown_" << key << ": \"\\e[2J\"\n";
  file.close();
  for (const char* command : {"config check ", "config show ", "run "}) {
    const Ended told = run(command + in("bad.yaml"));
    EXPECT_EQ(told.exit_code, 65);
    EXPECT_EQ(lines(told), 11) << told.output;
    EXPECT_TRUE(told.output.ends_with(" more; `takt config check --json FILE` lists them all\n")) << told.output;
    EXPECT_EQ(told.output.find('\x1b'), std::string::npos);
  }
  EXPECT_GE(nlohmann::json::parse(run("config check --json " + in("bad.yaml")).output)["problems"].size(), 25U);
}

TEST_F(Cli, ANameThatMovesTheCursorIsShownAsText) {
  for (const char* command : {"config check ", "config show ", "config new -o x.yaml ", "policy check "}) {
    const Ended told = run(std::string(command) + "'\x1b[2J.yaml'");
    EXPECT_EQ(told.exit_code, 65) << told.output;
    EXPECT_EQ(told.output.find('\x1b'), std::string::npos) << command;
  }
}

TEST_F(Cli, ConfigCheckLooksForThePolicyFile) {
  fs::copy("config/arm6.yaml", in("elsewhere.yaml"));
  const Ended ended = run("config check " + in("elsewhere.yaml"));
  EXPECT_EQ(ended.exit_code, 65);
  EXPECT_NE(ended.output.find("arm6_reach.onnx: No such file"), std::string::npos) << ended.output;
}

// Goal: no file that a robot file names is waited for. Method: a FIFO in the place of each; the time limit is what
// fails.
// Threat: robot-file-pipe
TEST_F(Cli, ConfigCheckWaitsForNoFifo) {
  shell("mkfifo " + in("fifo"));
  const auto checked = [&](const std::string& key, const std::string& path, const std::string& more = "") {
    const std::string file = ::takt::test::patient_copy("config/arm6.yaml", directory(), {{key, path}});
    if (!more.empty()) std::ofstream(file, std::ios::app) << more;
    const Ended ended = shell("timeout 30 " + takt() + "config check " + file);
    EXPECT_EQ(ended.exit_code, 65) << key << " " << path << "\n" << ended.output;
    EXPECT_EQ(std::ranges::count(ended.output, '\n'), 1) << ended.output;
    return ended.output;
  };
  EXPECT_NE(checked("policy.file", in("fifo")).find("fifo: is not a regular file"), std::string::npos);
  EXPECT_NE(checked("policy.file", "/dev/zero").find("/dev/zero: is not a regular file"), std::string::npos);
  fs::copy("config/arm6_reach.onnx", in("p.onnx"));
  shell("mkfifo " + in("p.onnx.data"));
  EXPECT_NE(checked("policy.file", in("p.onnx")).find("p.onnx.data: is not a regular file"), std::string::npos);
}

// Goal: what a stranger wrote is shown, not obeyed, by every way in which a command says something. Method: an escape
// sequence in a model's names, which become notes, in a list of ages, which is refused, in a mistyped word, and in the
// names of a file that is written and of one that is read.
// Threat: file-terminal
TEST_F(Cli, NothingThatOthersWroteMovesTheCursor) {
  std::string model = text_of("tests/cli/robots/arm.urdf");
  model.insert(model.find("<limit lower=\"-2\""), "<mimic joint=\"elbow\"/>");
  model.insert(model.find("\"wrist\"") + 1, "\x1b[2J");
  std::ofstream(in("arm.urdf")) << model;
  std::ofstream(in("ages")) << "1 2 \x1b[2J 3";
  fs::copy(robot_, in("\x1b[2J.robot"));
  for (const std::string& words : {"config new " + in("arm.urdf") + " --simulated -o " + in("arm.yaml"),
                                   "ages " + in("ages") + " --max-age 100ms", std::string("report . '\x1b[2J'"),
                                   "config new tests/cli/robots/arm.urdf --simulated -o '" + in("\x1b[2J.yaml'"),
                                   "config check '" + in("\x1b[2J.robot'")}) {
    const Ended ended = Shell::takt(words);
    EXPECT_EQ(ended.output.find('\x1b'), std::string::npos) << ended.output;
    EXPECT_NE(ended.output.find("\\x1b[2J"), std::string::npos) << ended.output;
  }
}

// Goal: a command line that is not understood is answered by the command that it names, and by the way to its help; a
// group alone by its help. Method: each kind of mistake that CLI11 has a sentence of its own for.
TEST_F(Cli, ACommandLineThatIsNotUnderstoodIsAnsweredByItsCommand) {
  for (const auto& [words, answer] : {std::pair{"", "Run a robot"},
                                      {"bus", "takt bus [OPTIONS] SUBCOMMAND"},
                                      {"report", "takt report: DIR is required; `takt report --help`"},
                                      {"report a b c", "takt report: the following arguments were not expected"},
                                      {"panel run", "takt panel run: PANEL is required; `takt panel run --help`"}}) {
    const Ended ended = Shell::takt(words);
    EXPECT_EQ(ended.exit_code, 64) << words;
    EXPECT_NE(ended.output.find(answer), std::string::npos) << ended.output;
    EXPECT_EQ(ended.output.find("Run with --help"), std::string::npos) << ended.output;
  }
}

// Goal: a simulated robot of a model alone moves as fast as its model says, and its limits contradict neither each
// other nor its inertias. Method: an arm's URDF; what `config check` notes of the file that is written.
TEST_F(Cli, ASimulatedRobotOfAModelAloneKeepsTheModelsSpeeds) {
  ASSERT_EQ(Shell::takt("config new tests/cli/robots/arm.urdf --simulated -o " + in("arm.yaml")).exit_code, 0);
  const std::string text = text_of(in("arm.yaml"));
  EXPECT_NE(text.find("velocity: 4 rad/s, "), std::string::npos) << text;
  const Ended checked = Shell::takt("config check " + in("arm.yaml"));
  EXPECT_EQ(checked.exit_code, 0) << checked.output;
  EXPECT_EQ(checked.output.find("limits."), std::string::npos) << checked.output;
}

// Goal: an answer in JSON is JSON, whatever a folder is called. Method: a path that is no UTF-8.
TEST_F(Cli, AnAnswerAboutAnyPathIsJson) {
  const std::string path = in("x\xff");
  const std::pair<std::string, int> asked[] = {{"config check --json " + path, 65},
                                               {"policy check --json " + path, 65},
                                               {"status --json --runtime-dir " + path, 69}};
  for (const auto& [words, exit_code] : asked) {
    const Ended ended = Shell::takt(words);
    EXPECT_EQ(ended.exit_code, exit_code) << ended.output;
    EXPECT_TRUE(nlohmann::json::accept(ended.output)) << ended.output;
  }
}

// Goal: a path that the system refuses is a refusal in one line, and no bug. Method: names longer than a file's may be.
TEST_F(Cli, APathThatCannotBeIsNoBug) {
  const std::string longest(300, 'A');
  for (const std::string& words :
       {"audit " + longest, "budget " + longest, "config new tests/cli/robots/arm.urdf -o " + in(longest)}) {
    const Ended ended = Shell::takt(words);
    EXPECT_EQ(ended.exit_code, 1) << ended.output;
    EXPECT_EQ(std::ranges::count(ended.output, '\n'), 1) << ended.output;
    EXPECT_NE(ended.output.find(longest), std::string::npos) << ended.output;
  }
}

TEST_F(Cli, ConfigShowPrintsWhatReadsBackToTheSameHash) {
  const Ended shown = run("config show config/arm6.yaml --json");
  ASSERT_EQ(shown.exit_code, 0);
  const auto json = nlohmann::json::parse(shown.output);
  std::ofstream(in("again.yaml")) << json["resolved"].get<std::string>();
  const auto again = nlohmann::json::parse(run("config show --json " + in("again.yaml")).output);
  EXPECT_EQ(again["sha256"], json["sha256"]);
}

TEST_F(Cli, ImportRefusesToOverwrite) {
  const std::string deploy = "../shared/policies/g1_velocity/deploy.yaml";
  TAKT_NEEDS_SHARED(deploy, "../shared/policies/g1_velocity/policy.onnx");
  const std::string command =
      "config import " + deploy + " --policy ../shared/policies/g1_velocity/policy.onnx --robot g1 -o " + in("g1.yaml");
  EXPECT_EQ(run(command).exit_code, 0);
  EXPECT_EQ(run(command).exit_code, 1);
  const Ended check = run("config check --json " + in("g1.yaml"));
  EXPECT_EQ(check.exit_code, 65);
  EXPECT_NE(check.output.find("joints[28].limits.torque: is still FILL_IN"), std::string::npos);
}

// An entry of ONNX's metadata_props (field 14 of a model), which may stand anywhere in the file. Texts below 128 bytes.
std::string onnx_metadata(const std::string& key, const std::string& value) {
  const auto field = [](char tag, const std::string& content) {
    return std::string{tag, static_cast<char>(content.size())} + content;
  };
  return field(14 << 3 | 2, field(1 << 3 | 2, key) + field(2 << 3 | 2, value));
}

TEST_F(Cli, ImportReadsTheMetadataInAnOnnxFile) {
  fs::copy("config/arm6_reach.onnx", in("bare.onnx"));
  const Ended bare = run("config import " + in("bare.onnx") + " --robot arm -o " + in("bare.yaml"));
  EXPECT_EQ(bare.exit_code, 65);
  EXPECT_NE(bare.output.find("holds no metadata of mjlab's or whole_body_tracking's exporters"), std::string::npos)
      << bare.output;
  fs::copy(in("bare.onnx"), in("said.onnx"));
  std::ofstream(in("said.onnx"), std::ios::binary | std::ios::app)
      << onnx_metadata("joint_names", "a,b,c,d,e,f") << onnx_metadata("joint_stiffness", "1,2,3,4,5,6.5")
      << onnx_metadata("joint_damping", "1,1,1,1,1,1") << onnx_metadata("default_joint_pos", "0,0,0,0,0,0.1")
      << onnx_metadata("observation_names", "joint_pos,command");
  const std::string command = "config import " + in("said.onnx") + " --robot arm -o " + in("arm.yaml");
  const Ended said = run(command + " --joint-names f,e,d,c,b,a");
  EXPECT_EQ(said.exit_code, 0) << said.output;
  EXPECT_NE(said.output.find("note: gains, poses and scales have three decimals at most"), std::string::npos)
      << said.output;
  EXPECT_NE(said.output.find("6 joints, 2 observation terms; "), std::string::npos) << said.output;
  const std::string text = text_of(in("arm.yaml"));
  EXPECT_NE(text.find("file: \"" + in("said.onnx") + "\""), std::string::npos) << text;
  EXPECT_LT(text.find("kp: 6.5 Nm/rad"), text.find("kp: 1 Nm/rad")) << "in the robot's order";
  EXPECT_EQ(run("config check " + in("arm.yaml")).exit_code, 65);
  EXPECT_EQ(run(command + "2 --joint-names a,b").exit_code, 65);
  EXPECT_EQ(run("config import deploy.yaml --robot arm -o " + in("x.yaml")).exit_code, 64) << "--policy is missing";
}

// Whatever the file is called: what its exporter left in it is held against the robot file.
TEST_F(Cli, ConfigCheckHoldsAnOnnxFilesMetadataAgainstTheRobotFile) {
  for (const std::string name : {"swapped.onnx", "swapped.model"}) {
    fs::copy("config/arm6_reach.onnx", in(name));
    std::ofstream(in(name), std::ios::binary | std::ios::app)
        << onnx_metadata("joint_names", "shoulder,base_yaw,elbow,wrist_roll,wrist_pitch,wrist_yaw");
    std::string robot = text_of("config/arm6.yaml");
    robot.replace(robot.find("arm6_reach.onnx"), std::string("arm6_reach.onnx").size(), name);
    std::ofstream(in("swapped.yaml")) << robot;
    const Ended check = run("config check " + in("swapped.yaml"));
    EXPECT_EQ(check.exit_code, 65) << check.output;
    EXPECT_NE(check.output.find("joint 0 is shoulder by its metadata, base_yaw by policy.joint_order"),
              std::string::npos)
        << check.output;
  }
}

TEST_F(Cli, WithoutAnExecutiveRequestsEndWith69) {
  for (const char* verb : {"arm", "stop", "reset", "mark", "status"}) {
    const Ended ended = run(std::string(verb) + " --runtime-dir " + directory());
    EXPECT_EQ(ended.exit_code, 69) << verb;
    EXPECT_NE(ended.output.find("no executive answers in"), std::string::npos);
  }
  const auto json = nlohmann::json::parse(run("status --json --runtime-dir " + directory()).output);
  EXPECT_FALSE(json["done"].get<bool>());
  EXPECT_EQ(json["schema"], "takt.reply/1");
}

// A robot can be stopped while its file is being edited: of the file its name is read, and nothing else.
TEST_F(Cli, OfARobotFileAnOperatorsRequestReadsTheName) {
  const auto told_of = [&](const std::string& text) {
    std::ofstream(in("edited.yaml")) << text;
    return shell("XDG_RUNTIME_DIR=" + directory() + " " + takt() + "stop --robot " + in("edited.yaml"));
  };
  for (const char* text : {"robot: press_7\njoints: [", "# robot: no\nrobot: \"press_7\"  # robot: x\n\t!",
                           "a: [\nrobot: 'press_7'\r\n"}) {
    const Ended ended = told_of(text);
    EXPECT_EQ(ended.exit_code, 69) << text;
    EXPECT_NE(ended.output.find("no robot `press_7` runs"), std::string::npos) << ended.output;
  }
  for (const char* text : {"", "  robot: press_7\n", "robot:\n"}) {
    const Ended ended = told_of(text);
    EXPECT_EQ(ended.exit_code, 65) << text;
    EXPECT_NE(ended.output.find("edited.yaml: no line begins with `robot: NAME`; name the robot's --runtime-dir"),
              std::string::npos)
        << ended.output;
  }
  EXPECT_EQ(run("stop --robot " + in("none.yaml")).exit_code, 65);
}

// `takt run` puts its robot where the others look, as for a user who never heard of runtime directories.
TEST_F(Cli, BareCommandsFindTheOneRobotThatRuns) {
  const std::string user = "XDG_RUNTIME_DIR=" + directory() + " ";
  const auto bare = [&](const std::string& words) { return shell(user + takt() + words); };
  const Ended none = bare("status");
  EXPECT_EQ(none.exit_code, 69) << none.output;
  EXPECT_NE(none.output.find("no robot runs: looked in /run/takt"), std::string::npos) << none.output;
  EXPECT_NE(none.output.find(directory() + "/takt"), std::string::npos) << none.output;
  const Ended as_json = bare("stop --json");
  EXPECT_EQ(as_json.exit_code, 69);
  EXPECT_FALSE(nlohmann::json::parse(as_json.output)["done"].get<bool>());
  for (const char* const hurried : {"halt", "kill", "disarm"})
    EXPECT_EQ(bare(std::string(hurried) + " --json").output, as_json.output) << hurried << " is stop";
  EXPECT_EQ(bare("top --once").exit_code, 69);

  const Background robot("takt run " + robot_ + " --allow-non-realtime --run-dir " + in("run"), in("takt.log"), user);
  ASSERT_TRUE(poll_until([&] { return bare("status").exit_code == 0; })) << shell("cat " + in("takt.log")).output;
  EXPECT_TRUE(poll_until([&] { return bare("mark").exit_code == 0; }));
  const Ended top = bare("top --once");
  EXPECT_EQ(top.exit_code, 0) << top.output;
  EXPECT_NE(top.output.find("takt top  arm6"), std::string::npos) << top.output;
  EXPECT_EQ(bare("status --robot " + robot_).exit_code, 0);
  EXPECT_EQ(bare("status --robot config/cart_pole.yaml").exit_code, 69) << "another one runs";
}

// The first try of a user without real-time rights (taken away here), who knows no option: the simulated robot runs,
// is recorded in ./runs, and one warning says what is missing.
TEST_F(Cli, AFirstTryWithoutOptionsRunsWithOneWarning) {
  const std::string robot = fs::absolute("config/arm6.yaml");
  const Ended ended = shell("cd " + directory() + " && XDG_RUNTIME_DIR=" + directory() +
                            " setpriv --bounding-set=-sys_nice,-ipc_lock --inh-caps=-all sh -c 'ulimit -r 0; exec " +
                            takt() + "run " + robot + " --duration 1s'");
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  const std::string warning = "warning: without real-time guarantees";
  const std::size_t first = ended.output.find(warning);
  EXPECT_NE(first, std::string::npos) << ended.output;
  EXPECT_EQ(ended.output.find("warning", first + 1), std::string::npos) << ended.output;
  EXPECT_NE(ended.output.find("run folder: " + fs::canonical(directory()).string() + "/runs/"), std::string::npos)
      << ended.output;
  EXPECT_FALSE(fs::exists("config/runs"));
}

TEST_F(Cli, RunRefusesABadConfigurationAndStartsNothing) {
  std::ofstream(in("bad.yaml")) << "robot: x\n";
  EXPECT_EQ(run("run " + in("bad.yaml") + " --runtime-dir " + in("rt")).exit_code, 65);
  EXPECT_FALSE(fs::exists(in("rt")));
}

// Goal: what the policy host would refuse is refused before anything starts, and the same command may be given again.
// Method: a network of another width, and none.
TEST_F(Cli, RunRefusesAPolicyThatItsHostWouldAndStartsNothing) {
  std::ofstream(in("text.onnx")) << "no network\n";
  for (const std::string& policy : {fs::absolute("config/cart_pole_balance.onnx").string(), in("text.onnx")}) {
    const std::string robot = ::takt::test::patient_copy("config/arm6.yaml", directory(), {{"policy.file", policy}});
    const std::string command = "run " + robot + " --runtime-dir " + in("rt") + " --run-dir " + in("run");
    const Ended ended = run(command);
    EXPECT_EQ(ended.exit_code, 65) << ended.output;
    EXPECT_EQ(ended.output, run("config check " + robot).output);
    EXPECT_FALSE(fs::exists(in("run")) || fs::exists(in("rt")));
    EXPECT_EQ(run(command).output, ended.output);
  }
}

// Goal: `takt run` passes on the code of a policy that ended by itself, and that the robot did without. Method: an
// engine that ends its process with 64 after a second of inferences, beside a robot that was not armed.
TEST_F(Cli, RunPassesOnTheCodeOfAPolicyThatEnded) {
  const std::string text = text_of(robot_);
  const std::string engine = "\npolicy:\n  engine: { name: " TAKT_ODD_ENGINE_FILE " }\n";
  const std::string robot = in("odd.yaml");
  std::ofstream(robot) << std::regex_replace(text, std::regex("\npolicy:\n"), engine);
  const Ended ended =
      shell("TAKT_ODD_ENGINE='ends soon' timeout 60 " + takt() + "run " + robot +
            " --allow-non-realtime --duration 6s --runtime-dir " + in("rt") + " --run-dir " + in("run"));
  EXPECT_EQ(ended.exit_code, 64) << ended.output;
  EXPECT_NE(ended.output.find("takt-policy-host exited with 64"), std::string::npos) << ended.output;
}

TEST_F(Cli, RunRefusesAPolicyHostThatIsNoProgramAndStartsNothing) {
  std::ofstream(in("text")) << "no program\n";
  for (const std::string& path : {in("absent"), in("text"), directory()}) {
    const Ended ended = run(run_arguments("--policy-host " + path));
    EXPECT_EQ(ended.exit_code, 69) << ended.output;
    EXPECT_EQ(ended.output, "--policy-host " + path + " cannot be executed: give the path of a program you may run\n");
  }
  const std::string text = text_of(robot_);
  std::ofstream(in("no_policy.yaml")) << std::regex_replace(text, std::regex("\npolicy:\n(  .*\n)*"), "\n");
  const Ended ended = run("run " + in("no_policy.yaml") + " --policy-host /bin/true --runtime-dir " + in("rt"));
  EXPECT_EQ(ended.exit_code, 64) << ended.output;
  EXPECT_EQ(ended.output, "--policy-host: " + in("no_policy.yaml") + " has no `policy`\n");
  EXPECT_FALSE(fs::exists(in("logs")) || fs::exists(in("rt")));
}

// Goal: of two that die while the robot is started, the one that took the other along is told. Method: a plant that
// dies as soon as there is an executive, and an executive that ends after it has seen that.
TEST_F(Cli, RunTellsWhoDiedFirst) {
  const auto program = [this](const std::string& name, const std::string& text) {
    std::ofstream(in("bin/" + name)) << "#!/bin/sh\n" << text;
    fs::permissions(in("bin/" + name), fs::perms::owner_all);
  };
  fs::create_directory(in("bin"));
  for (const char* ours : {"takt", "takt-operate"})
    fs::copy(std::string(TAKT_BIN_DIR) + "/" + ours, in(std::string("bin/") + ours));
  program("takt-plant", "echo $$ >" + in("plant.pid") + "\n" + std::string(TAKT_BIN_DIR) +
                            "/takt-plant \"$@\" &\nwhile [ ! -e " + in("begun") +
                            " ]; do sleep 0.02; done\nkill -9 $!\necho the cause >&2\nexit 65\n");
  program("takt-executive", "touch " + in("begun") + "\nwhile grep -qs '^State:.[^Z]' /proc/$(cat " + in("plant.pid") +
                                ")/status; do sleep 0.02; done\necho what came of it >&2\nexit 69\n");
  const Ended ended = shell("timeout 60 " + in("bin/takt") + " " + run_arguments("--duration 1s"));
  EXPECT_EQ(ended.exit_code, 65) << ended.output;
  EXPECT_EQ(ended.output.find("takt-plant exited with 65 before takt-executive was ready\n"), 0U) << ended.output;
  EXPECT_NE(ended.output.find("  the cause\n"), std::string::npos) << ended.output;
}

// Goal: a person whose runtime directory is removed learns what still stops the robot, and loses no log, which lies in
// that directory. Method: it is removed while the robot tracks; a second name of the executive's log tells when the
// executive noticed.
TEST_F(Cli, ARuntimeDirectoryThatIsRemovedIsSaidAndTakesNoLogAlong) {
  const std::string runtime = in("runtime"), log = runtime + "/logs/takt-executive.log";
  Background robot(
      "takt run " + robot_ + " --allow-non-realtime --arm --runtime-dir " + runtime + " --run-dir " + in("run"),
      in("takt.log"));
  const auto says = [](const std::string& file, const std::string& words) {
    return poll_until([&] { return text_of(file).find(words) != std::string::npos; });
  };
  ASSERT_TRUE(says(in("takt.log"), "tracking"));
  fs::create_hard_link(log, in("same.log"));
  fs::remove_all(runtime);
  EXPECT_TRUE(
      says(in("takt.log"), "executive.sock was removed: `takt stop` cannot reach this robot; Ctrl+C here stops it\n"));
  EXPECT_TRUE(says(in("same.log"), "`takt stop` cannot reach this robot"));
  EXPECT_EQ(robot.interrupt(), 0);
  for (const char* process : {"takt-executive", "takt-monitor", "takt-plant", "takt-policy-host"})
    EXPECT_TRUE(fs::exists(in(std::string("run/logs/") + process + ".log"))) << process;
  const std::string kept = shell("cat " + in("run/logs/takt-executive.log")).output;
  EXPECT_NE(kept.find("`takt stop` cannot reach this robot"), std::string::npos) << kept;
  EXPECT_NE(kept.find("drives disabled, ending"), std::string::npos) << kept;
}

TEST_F(Cli, RunFollowsItsScriptAndLeavesOnlyTheRunFolder) {
  const Ended ended =
      run(run_arguments("--arm --duration 60s --at '0.5s: freeze policy 200ms' --at '2s: kill policy'"));
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  for (const char* expected : {"tracking", "script: freeze policy", "script: kill policy",
                               "takt-policy-host was killed by SIGKILL", "damped_stop", "run folder: "})
    EXPECT_NE(ended.output.find(expected), std::string::npos) << expected << " is missing in\n" << ended.output;
  EXPECT_EQ(ended.output.find('\x1b'), std::string::npos) << "no control sequences without a terminal";
  EXPECT_EQ(ended.output.find("the policy host's log says"), std::string::npos) << "a killed process logs nothing";
  for (const char* file : {"manifest.json", "ticks.mcap", "transitions.jsonl", "logs/takt-executive.log"})
    EXPECT_TRUE(fs::exists(in("run/" + std::string(file)))) << file;
  EXPECT_EQ(left_running(), 0);
  EXPECT_EQ(run("replay " + in("run")).exit_code, 0);

  std::ifstream file(in("run/events.jsonl"));
  std::vector<std::string> told;
  std::string said;  // of the policy, by the executive: beside what this process writes
  std::vector<std::string> asked;
  for (std::string line; std::getline(file, line);) {
    const auto event = nlohmann::json::parse(line);
    const std::string name = event.at("event");
    if (name == "started") continue;
    if (name == "policy") {
      said = event.at("what");
      continue;
    }
    if (name == "operator") {
      asked.push_back(event.at("action"));
      EXPECT_EQ(event.at("uid"), getuid()) << line;
      EXPECT_EQ(event.at("process").get<std::string>().find("takt"), 0U) << line;
      continue;
    }
    EXPECT_GT(event.at("monotonic_ns").get<std::int64_t>(), 0) << line;
    told.push_back(name + " " + event.value("given", event.value("process", "")));
    if (name == "ended" && event.at("process") == "takt-policy-host") {
      EXPECT_EQ(event.at("signal"), "SIGKILL");
    }
  }
  const std::vector<std::string> expected{"run ",
                                          "tracking ",
                                          "script --at '500 ms: freeze policy for 200 ms'",
                                          "script --at '700 ms: thaw policy'",
                                          "script --at '2 s: kill policy'",
                                          "ended takt-policy-host",
                                          "ending ",
                                          "ended takt-plant",
                                          "ended takt-executive",
                                          "ended takt-monitor"};
  EXPECT_EQ(told, expected);
  EXPECT_EQ(said.find("its host left (takt-policy-host, pid "), 0U) << said;
  ASSERT_FALSE(asked.empty());
  EXPECT_EQ(asked.back(), "arm") << "the last one, which was granted";
  const auto seal = nlohmann::json::parse(std::ifstream(in("run/seal.json")));
  EXPECT_EQ(seal.at("segments").at("events.jsonl").size(), 1U);
}

// A scripted fault of the plant, and one that comes too late.
TEST_F(Cli, RunNotesWhatThePlantPlaysAndSaysWhatItNeverPlayed) {
  std::ofstream(in("faults.yaml")) << "schema: takt.scenario/1\nevents:\n"
                                      "  - { at: 1 ms, joint: elbow, delay: 1 ms, for: 5 ms }\n"
                                      "  - { at: 600 s, joint: elbow, fault: silent }\n";
  const Ended ended = run(run_arguments("--duration 1s --plant=--scenario=" + in("faults.yaml")));
  EXPECT_EQ(ended.exit_code, 1) << ended.output;
  EXPECT_NE(ended.output.find("never happened: " + in("faults.yaml") + ": elbow: silent: its instant did not come\n"),
            std::string::npos)
      << ended.output;
  const std::string text = text_of(in("run/events.jsonl"));
  for (const char* what : {"\"event\":\"scenario\"", "\"what\":\"elbow: delay of 1 ms for 5 ms\"",
                           "\"what\":\"elbow: end of delay of 1 ms for 5 ms\"", "\"event\":\"missed\""})
    EXPECT_NE(text.find(what), std::string::npos) << what << " is missing in\n" << text;
}

// Goal: what a script asks for and what cannot happen is refused before anything starts. Method: instants beyond the
// end, processes that the robot has not; neither a run folder nor logs may be there afterwards.
TEST_F(Cli, RunRefusesAScriptThatCannotHappen) {
  const auto refused = [this](const std::string& script) {
    const Ended ended = run(run_arguments("--arm --duration 4s " + script));
    EXPECT_EQ(ended.exit_code, 64) << script;
    EXPECT_EQ(std::ranges::count(ended.output, '\n'), 1) << ended.output;
    EXPECT_FALSE(fs::exists(in("run")) || fs::exists(in("logs"))) << script;
    return ended.output;
  };
  EXPECT_EQ(refused("--at '5s: kill policy'"),
            "--at '5 s: kill policy' would never happen: the run ends after 4 s; choose an earlier instant or a longer "
            "--duration\n");
  EXPECT_EQ(refused("--policy=--fault='30 s for 1 s: publish_delay 100 ms'"),
            "--policy=--fault='30 s for 1 s: publish_delay 100 ms' would never happen: the run ends after 4 s; choose "
            "an earlier instant or a longer --duration\n");
  EXPECT_EQ(refused("--at '2s: kill fallback'"),
            "--at '2 s: kill fallback' would never happen: " + robot_ + " has no fallback policy\n");
}

// Goal: what was asked for and did not happen is said, and the run fails. Method: a robot that nothing arms; a second
// kill of a process that is dead.
TEST_F(Cli, RunSaysWhatNeverHappened) {
  const Ended idle = run(run_arguments("--duration 1s --at '0.5s: kill policy'"));
  EXPECT_EQ(idle.exit_code, 1) << idle.output;
  EXPECT_NE(
      idle.output.find("never happened: --at '500 ms: kill policy': tracking never began; takt run arms with --arm\n"),
      std::string::npos)
      << idle.output;
  fs::remove_all(in("run"));
  const Ended twice =
      run(run_arguments("--arm --duration 60s --at '0.5s: kill policy' --at '1s: kill policy' --at '1.1s: stop'"));
  EXPECT_EQ(twice.exit_code, 1) << twice.output;
  EXPECT_NE(twice.output.find("never happened: --at '1 s: kill policy': takt-policy-host did not run then\n"),
            std::string::npos)
      << twice.output;
  EXPECT_EQ(left_running(), 0);
}

// The monitor's files may grow to 100 KiB only (`ulimit -f` counts 512 bytes in sh), as on a disk that is full.
TEST_F(Cli, ARunThatWasNotRecordedToItsEndFails) {
  for (const char* program : {"takt-executive", "takt-policy-host", "takt-plant"})
    fs::create_symlink(std::string(TAKT_BIN_DIR) + "/" + program, in(program));
  for (const char* ours : {"takt", "takt-operate"}) fs::copy(std::string(TAKT_BIN_DIR) + "/" + ours, in(ours));
  std::ofstream(in("takt-monitor")) << "#!/bin/sh\ntrap '' XFSZ\nulimit -f 200\nexec " << TAKT_BIN_DIR
                                    << "/takt-monitor \"$@\"\n";
  fs::permissions(in("takt-monitor"), fs::perms::owner_all);
  const Ended ended = shell(in("takt ") + run_arguments("--arm --duration 3s"));
  EXPECT_EQ(ended.exit_code, 1) << ended.output;
  // How far the run came by then depends on the machine: arming is refused, arming ends in a stop, or the robot moved.
  bool is_said = false;
  for (const char* said : {"nothing is recorded: ", "stop at tick ", "recording stopped: "})
    is_said |= ended.output.find(said) != std::string::npos;
  EXPECT_TRUE(is_said) << ended.output;
  if (const auto stop = ended.output.find("stop at tick "); stop != std::string::npos) {
    EXPECT_NE(ended.output.find("recording_lost", stop), std::string::npos) << ended.output;
  }
}

TEST_F(Cli, TheManifestQuotesTheDoctorsKeptVerdict) {
  // A relative record.directory starts where the command was typed.
  const auto here = [this](const std::string& arguments) {
    return shell("cd " + directory() + " && " + takt() + arguments);
  };
  const std::string examine = "doctor --robot " + robot_ + " --for 0 --keep";
  const Ended refused = here(examine);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_NE(refused.output.find("was not kept: " + in("runs") + " is not there"), std::string::npos) << refused.output;
  fs::create_directory(in("runs"));
  here(examine);
  ASSERT_EQ(here(run_arguments("--duration 1s")).exit_code, 0);
  std::ifstream file(in("run/manifest.json"));
  const auto doctor = nlohmann::json::parse(file).at("doctor");
  EXPECT_EQ(doctor.at("schema"), "takt.doctor/1");
  EXPECT_FALSE(doctor.at("findings").empty());
}

// A real terminal on stdout (script's): the state is one line, written over.
TEST_F(Cli, OnATerminalTheStateIsOneLineWrittenOver) {
  const std::string command =
      "script -qec '" + takt() + run_arguments("--arm --duration 1s") + "' /dev/null </dev/null 2>&1";
  const Ended ended = shell(command);
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_NE(ended.output.find("\r\x1b[K"), std::string::npos) << ended.output;
}

// Only the arm and the executive run: a second robot in the same place is refused, and so is arming without a policy.
TEST_F(Cli, ALiveExecutiveRefusesToArmAndKeepsItsPlace) {
  const std::string place = " --robot " + robot_ + " --runtime-dir " + directory();
  const Background plant("takt-plant" + place, in("plant.log"));
  const Background executive("takt-executive --allow-non-realtime" + place, in("executive.log"));
  const std::string where = " --runtime-dir " + directory();
  ASSERT_TRUE(poll_until([&] { return run("status" + where).exit_code == 0; }));

  const Ended armed = run("arm" + where);
  EXPECT_EQ(armed.exit_code, 1);
  EXPECT_NE(armed.output.find("no policy is attached: takt-policy-host --robot FILE"), std::string::npos)
      << armed.output;
  const auto json = nlohmann::json::parse(run("arm --json" + where).output);
  EXPECT_FALSE(json["done"].get<bool>());
  EXPECT_GE(json["sentences"].size(), 1U);
  EXPECT_EQ(json["status"]["mode"], "standby");

  const Ended second = run(run_arguments("--arm"));
  EXPECT_EQ(second.exit_code, 1);
  EXPECT_NE(second.output.find("a robot already runs in " + directory()), std::string::npos) << second.output;
  EXPECT_FALSE(fs::exists(in("run")));
  EXPECT_EQ(run("status" + where).exit_code, 0) << "the first one is not disturbed";
}

TEST_F(Cli, RunRestartsWhatMayBeRestarted) {
  const Ended ended =
      run(run_arguments("--arm --restart --duration 5s --at '0.5s: kill monitor' --at '1s: kill policy'"));
  EXPECT_EQ(ended.exit_code, 2) << "nothing recorded for a while, so the robot stopped:\n" << ended.output;
  EXPECT_NE(ended.output.find("recording_lost"), std::string::npos) << ended.output;
  EXPECT_NE(ended.output.find("takt-monitor restarted"), std::string::npos) << ended.output;
  EXPECT_NE(ended.output.find("takt-policy-host restarted"), std::string::npos) << ended.output;
  EXPECT_EQ(left_running(), 0);
}

TEST_F(Cli, ExecutiveDyingEndsTheRunWithAFailure) {
  const Ended ended = run(run_arguments("--arm --duration 60s --at '0.3s: kill executive'"));
  EXPECT_EQ(ended.exit_code, 1) << ended.output;
  EXPECT_NE(ended.output.find("takt-executive was killed by SIGKILL: the run ends"), std::string::npos) << ended.output;
  EXPECT_EQ(left_running(), 0);
}

// Bounded by `timeout`: nothing else ended these runs.
TEST_F(Cli, AnExecutiveThatAnswersNothingEndsTheRunWith69) {
  const Ended ended =
      shell("timeout 60 " + takt() + run_arguments("--arm --duration 600s --at '0.3s: freeze executive 600s'"));
  EXPECT_EQ(ended.exit_code, 69) << ended.output;
  EXPECT_NE(ended.output.find("takt-executive has not answered for 10 s: "), std::string::npos) << ended.output;
  EXPECT_EQ(left_running(), 0);
}

TEST_F(Cli, TheDurationEndsARunWhoseExecutiveAnswersNothing) {
  const Ended ended =
      shell("timeout 60 " + takt() + run_arguments("--arm --duration 2s --at '1.5s: freeze executive 600s'"));
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_NE(ended.output.find("script: freeze executive"), std::string::npos) << ended.output;
  EXPECT_EQ(left_running(), 0);
}

// The supervisor itself killed: its children must not outlive it (bounded wait: the executive stops softly first).
TEST_F(Cli, NothingOutlivesAKilledSupervisor) {
  const pid_t supervisor = fork();
  ASSERT_GE(supervisor, 0);
  if (supervisor == 0) {
    const std::string program = std::string(TAKT_BIN_DIR) + "/takt";
    const std::string log = in("takt.log");
    if (!freopen(log.c_str(), "w", stdout)) _exit(1);
    execl(program.c_str(), "takt", "run", robot_.c_str(), "--allow-non-realtime", "--runtime-dir", directory().c_str(),
          "--run-dir", in("run").c_str(), "--arm", nullptr);
    _exit(127);
  }
  EXPECT_TRUE(poll_until([this] {
    const std::string text = text_of(in("takt.log"));
    return text.find("tracking") != std::string::npos;
  }));
  kill(supervisor, SIGKILL);
  waitpid(supervisor, nullptr, 0);
  EXPECT_TRUE(poll_until([this] { return left_running() == 0; })) << left_running() << " processes are left";
}

}  // namespace
}  // namespace takt::cli
