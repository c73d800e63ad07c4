// SPDX-License-Identifier: Apache-2.0
// Goal: `takt policy` says what a policy file is and whether it fits a robot, before anything moves, and ends with the
// documented exit codes. Method: the real binary on the demo's policies and on files that are none.
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/cli/shell.hpp"
#include "tests/support/files.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;
using test::Ended;

class PolicyCli : public test::Shell {};

TEST_F(PolicyCli, CheckSaysWhatAPolicyIsAndThatItFits) {
  const Ended ended = takt("policy check config/arm6_reach.onnx --robot config/arm6.yaml");
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  for (const char* part :
       {"runs on the built-in engine", "opset ", "operators ", "observation ", "actions ", "fits "}) {
    EXPECT_NE(ended.output.find(part), std::string::npos) << part << " not in\n" << ended.output;
  }
}

TEST_F(PolicyCli, CheckInJsonIsOneObject) {
  const Ended ended = takt("policy check config/arm6_reach.onnx --json");
  ASSERT_EQ(ended.exit_code, 0) << ended.output;
  const auto about = nlohmann::json::parse(ended.output);
  EXPECT_EQ(about["runs"], true);
  EXPECT_TRUE(about["operators"].contains("Gemm")) << about;
  EXPECT_EQ(about["observation"].size(), 1U);
  EXPECT_TRUE(about["external_data"].empty());
}

TEST_F(PolicyCli, CheckRefusesThePolicyOfAnotherRobotWithBothSizes) {
  const Ended ended = takt("policy check config/cart_pole_balance.onnx --robot config/arm6.yaml");
  EXPECT_EQ(ended.exit_code, 65) << ended.output;
  EXPECT_NE(ended.output.find("config/cart_pole_balance.onnx: "), std::string::npos) << ended.output;
  EXPECT_NE(ended.output.find("values"), std::string::npos) << ended.output;
}

TEST_F(PolicyCli, CheckSaysWhichValuesComeFromWhichTerm) {
  const Ended ended = takt("policy check config/arm6_reach.onnx --robot config/arm6.yaml");
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  for (const char* const line :
       {"bound          obs 0..5: joint_position_relative of 6 joints, rad from home\n",
        "bound          obs 6..11: joint_velocity of 6 joints, rad/s, times 0.1\n",
        "bound          obs 12..17: sensor target, 3 values, unit unstated, 2 instants, oldest first\n",
        "bound          obs 18..23: last_action of 6 joints, as the network gave it\n",
        "bound          actions: joint_position of 6 joints, rad, times "})
    EXPECT_NE(ended.output.find(line), std::string::npos) << line << "\n" << ended.output;
}

TEST_F(PolicyCli, CheckRefusesWhatIsNoPolicy) {
  const Ended ended = takt("policy check README.md");
  EXPECT_EQ(ended.exit_code, 65);
  EXPECT_NE(ended.output.find("not an ONNX model"), std::string::npos) << ended.output;
  const Ended json = takt("policy check " + in("absent.onnx") + " --json");
  EXPECT_EQ(json.exit_code, 65);
  EXPECT_EQ(nlohmann::json::parse(json.output)["runs"], false);
}

TEST_F(PolicyCli, CheckReadsALeappBundleAndItsModelsHash) {
  fs::copy_file("config/arm6_reach.onnx", in("reach.onnx"));
  const auto bundle = [&](const std::string& sha256) {
    std::ofstream(in("reach.yaml"))
        << "models:\n"
           "  reach:\n"
           "    inputs: [{name: obs, dtype: float32, shape: [1, 3], kind: state/vector3d}]\n"
           "    outputs: [{name: q, dtype: float32, shape: [1, 6]}]\n"
           "    parameters: {model_path: reach.onnx, backend: onnx, opset_version: 9, sha256sum: '"
        << sha256
        << "'}\n"
           "pipeline: {inputs: {reach: [obs]}, outputs: {reach: [q]}}\n";
  };
  const Ended sum = shell("sha256sum " + in("reach.onnx"));
  bundle(sum.output.substr(0, 64));
  const Ended fine = takt("policy check " + in("reach.yaml"));
  EXPECT_EQ(fine.exit_code, 0) << fine.output;
  EXPECT_NE(fine.output.find("obs [1,3], state/vector3d"), std::string::npos) << fine.output;
  EXPECT_NE(fine.output.find("sha256 as in the bundle"), std::string::npos) << fine.output;
  EXPECT_NE(fine.output.find("differs        reach.onnx: opset 13, the bundle says 9\n"), std::string::npos)
      << fine.output;
  EXPECT_EQ(fine.output.find("left open "), std::string::npos) << fine.output;
  // What the file leaves open is said: which of a command's values is which.
  const Ended open = shell("sed -i s,state/vector3d,command/body/velocity, " + in("reach.yaml") +
                           " && " TAKT_BIN_DIR "/takt policy check " + in("reach.yaml"));
  EXPECT_EQ(open.exit_code, 0) << open.output;
  EXPECT_NE(open.output.find("left open      obs: no names for 3 values"), std::string::npos) << open.output;
  // With a robot the bundle is loaded by the engine that the robot file names.
  const Ended robot = shell("cp config/arm6.yaml " + in("robot.yaml") +
                            " && sed -i 's,^policy:$,policy:\\n  engine: "
                            "{ name: /nowhere/engine.so },' " +
                            in("robot.yaml") + " && " TAKT_BIN_DIR "/takt policy check " + in("reach.yaml") +
                            " --robot " + in("robot.yaml"));
  EXPECT_EQ(robot.exit_code, 65) << robot.output;
  EXPECT_NE(robot.output.find("/nowhere/engine.so: cannot be loaded"), std::string::npos) << robot.output;
  bundle(std::string(64, '0'));
  const Ended other = takt("policy check " + in("reach.yaml"));
  EXPECT_EQ(other.exit_code, 65) << other.output;
  EXPECT_NE(other.output.find("is not the bundle's 0000"), std::string::npos) << other.output;
  EXPECT_EQ(takt("policy check " + in("reach.yaml") + " --json").exit_code, 64);
  EXPECT_EQ(takt("policy check config/arm6.yaml").exit_code, 65) << "no bundle";
}

// Thresholds of a panel's nominal rollouts go into the robot file as they are printed.
// Goal: a bundle cannot have files read that lie elsewhere, nor a folder or a FIFO taken for one. Method: model_path
// and initial_values that do, with and without a robot.
TEST_F(PolicyCli, CheckReadsNoFileOfABundleThatIsNotBesideIt) {
  fs::create_directory(in("bundle"));
  fs::copy_file("config/arm6_reach.onnx", in("outside.onnx"));
  fs::create_symlink("../outside.onnx", in("bundle/link.onnx"));
  shell("mkfifo " + in("bundle/fifo.onnx"));
  const auto said = [&](const std::string& model, const std::string& values) {
    std::ofstream(in("bundle/b.yaml")) << "models:\n"
                                          "  reach:\n"
                                          "    inputs: [{name: obs, dtype: float32, shape: [1, 24]}]\n"
                                          "    outputs: [{name: q, dtype: float32, shape: [1, 96]}]\n"
                                          "    parameters: {model_path: "
                                       << model
                                       << ", backend: onnx, sha256sum: '00'}\n"
                                          "pipeline: {inputs: {reach: [obs]}, outputs: {reach: [q]}, initial_values: "
                                       << values << "}\n";
    const Ended ended = shell("timeout 60 " TAKT_BIN_DIR "/takt policy check " + in("bundle/b.yaml"));
    EXPECT_EQ(ended.exit_code, 65) << model << "\n" << ended.output;
    return ended.output;
  };
  for (const char* const model : {"..", ".", "../outside.onnx", "../../etc/passwd", "/etc/passwd"})
    EXPECT_NE(said(model, "v.safetensors").find(std::string("model_path ") + model + " is not beside it"),
              std::string::npos)
        << model;
  EXPECT_NE(said("link.onnx", "v").find("model_path link.onnx is a link that leaves its folder"), std::string::npos);
  EXPECT_NE(said("fifo.onnx", "v").find("model_path fifo.onnx is not a regular file"), std::string::npos);
  EXPECT_NE(said("absent.onnx", "../v").find("initial_values ../v is not beside it"), std::string::npos);
}

// Goal: a file that there is no memory for is refused by name. Method: a large one, and little memory.
TEST_F(PolicyCli, CheckNamesAFileThatThereIsNoMemoryFor) {
  std::ofstream(in("large.onnx")) << "no network";
  fs::resize_file(in("large.onnx"), std::uintmax_t{900} << 20U);  // no bytes on the disk
  const Ended ended = shell("ulimit -v 700000; " TAKT_BIN_DIR "/takt policy check " + in("large.onnx"));
  EXPECT_EQ(ended.exit_code, 65) << ended.output;
  EXPECT_EQ(ended.output, in("large.onnx") + ": not enough memory to load it\n");
}

TEST_F(PolicyCli, CalibratePrintsWhatTheRobotFileTakes) {
  std::ofstream(in("panel.yaml"))
      << "schema: takt.panel/1\npanel: usual\nduration: 4 s\nseeds: { first: 1, count: 40 }\n"
         "tasks: [{ task: arm_tracking, robot: "
      << fs::absolute("config/arm6.yaml").string()
      << ", scored: 1 s, bound: 40 mm }]\n"
         "methods: [{ name: takt, description: as it is }]\n"
         "perturbations: [{ kind: none }]\n";
  ASSERT_EQ(takt("panel run " + in("panel.yaml") + " --out " + in("usual")).exit_code, 0);
  const Ended few = takt("policy calibrate " + in("usual"));
  EXPECT_EQ(few.exit_code, 1);
  EXPECT_NE(few.output.find("are too few for 5 scores"), std::string::npos) << few.output;
  const Ended made = shell("(" + std::string(TAKT_BIN_DIR) + "/takt policy calibrate " + in("usual") +
                           " --scores jerk,stall --alarms 0.2 2>/dev/null)");
  ASSERT_EQ(made.exit_code, 0) << made.output;
  const std::string robot = takt::test::text_of("config/arm6.yaml");
  const std::size_t below = robot.find("policy:\n") + 8;
  std::string section;
  std::istringstream lines(made.output);
  for (std::string line; std::getline(lines, line);) section += "  " + line + "\n";
  std::ofstream(in("robot.yaml")) << robot.substr(0, below) << section << robot.substr(below);
  fs::copy_file("config/arm6_reach.onnx", in("arm6_reach.onnx"));
  const Ended checked = takt("config check " + in("robot.yaml"));
  EXPECT_EQ(checked.exit_code, 0) << checked.output << section;
}

TEST_F(PolicyCli, TryMakesATableWithReasons) {
  fs::create_directory(in("below"));
  fs::copy_file("config/arm6_reach.onnx", in("below/reach.onnx"));
  std::ofstream(in("bad.onnx")) << "no | model";
  std::ofstream(in("script.pt")) << "PK";  // as a TorchScript file begins
  // A bundle counts as one, and a YAML that is none not at all.
  fs::create_directory(in("bundle"));
  fs::copy_file("config/arm6_reach.onnx", in("bundle/walk.onnx"));
  fs::copy_file("config/arm6.yaml", in("bundle/robot.yaml"));
  std::ofstream(in("bundle/walk.yaml")) << "models:\n"
                                           "  walk:\n"
                                           "    inputs: [{name: obs, dtype: float32, shape: [1, 24]}]\n"
                                           "    outputs: [{name: actions, dtype: float32, shape: [1, 96]}]\n"
                                           "    parameters: {model_path: walk.onnx, backend: onnx, sha256sum: '"
                                        << std::string(64, '0')
                                        << "'}\n"
                                           "pipeline: {inputs: {walk: [obs]}, outputs: {walk: [actions]}}\n";
  const Ended printed = takt("policy try " + directory());
  EXPECT_EQ(printed.exit_code, 0) << printed.output;
  for (const char* const part : {"4 files, 1 load:\n\n- builtin 1\n\n", "Not judged: no ONNX Runtime was named",
                                 "## The folder itself\n\n2 files, 0 load", "| bad.onnx | none: not an ONNX model",
                                 "| script.pt | torchscript refuses: ", "## below\n\n1 file, 1 load:\n\n- builtin 1\n",
                                 "| reach.onnx | builtin | 24→96 |", "| walk.yaml | none: walk.onnx: sha256 "})
    EXPECT_NE(printed.output.find(part), std::string::npos) << part << " is not in\n" << printed.output;
  EXPECT_EQ(printed.output.find(directory()), std::string::npos) << "the table names a folder of this machine";

  const Ended written = takt("policy try " + directory() + " --out " + in("tried.md"));
  EXPECT_EQ(written.exit_code, 0) << written.output;
  EXPECT_TRUE(fs::exists(in("tried.md")));
  EXPECT_EQ(takt("policy try " + directory() + " --out " + in("no/such/tried.md")).exit_code, 1);
}

TEST_F(PolicyCli, TryRefusesWhatItCannotDo) {
  EXPECT_EQ(takt("policy try " + in("absent")).exit_code, 64);
  EXPECT_EQ(takt("policy try " + directory()).exit_code, 1);
  const Ended library = takt("policy try config --onnxruntime config/arm6.yaml");
  EXPECT_EQ(library.exit_code, 69);
  EXPECT_NE(library.output.find("config/arm6.yaml: cannot be loaded"), std::string::npos) << library.output;
}

}  // namespace
}  // namespace takt::cli
