// SPDX-License-Identifier: Apache-2.0
// Goal: with nothing but what takt-dev installs, a user builds an engine of their own, the policy host runs it by the
// robot file's word, and the run replays. Method: the installation is staged in a folder, the installed example is
// compiled against it alone, and runs the demo robot from a policy file that is no ONNX.
#include <gtest/gtest.h>

#include <fstream>

#include "tests/cli/shell.hpp"
#include "tests/process/patient_copy.hpp"
#include "tests/support/files.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;
using test::Ended;

using takt::test::text_of;

class OwnEngine : public test::Shell {
 protected:
  void SetUp() override {
    if (shell("command -v gcc").exit_code != 0) GTEST_SKIP() << "NOT TESTED: gcc is not installed";
    const std::string stage = in("stage");
    const Ended installed = shell("cmake --install " TAKT_BUILD_DIR " --component dev --prefix " + stage);
    ASSERT_EQ(installed.exit_code, 0) << installed.output;
    const Ended built = shell(
        "env -u CPATH gcc -std=c11 -Wall -Wextra -Wpedantic -Werror -O2 -shared -fPIC -fvisibility=hidden -I" + stage +
        "/include " + stage + "/share/doc/takt-dev/examples/own-engine/home_pose.c -o " + in("home-pose.so"));
    ASSERT_EQ(built.exit_code, 0) << built.output;
  }
  // The demo robot with the engine, and a file of the engine's own in the place of the ONNX file.
  [[nodiscard]] std::string robot_with(const std::string& options) const {
    std::ofstream(in("engine")) << "home\n";
    const std::string robot = ::takt::test::patient_copy("config/arm6.yaml", directory());
    std::string text = text_of(robot);
    const std::string file = "\"" + fs::absolute("config/arm6_reach.onnx").string() + "\"";
    const auto at = text.find(file);
    if (at == std::string::npos) throw std::runtime_error(robot + " does not say " + file);
    text.replace(at, file.size(), in("engine") + "\n  engine: { name: " + in("home-pose.so") + options + " }");
    std::ofstream(robot) << text;
    return robot;
  }
  [[nodiscard]] Ended run(const std::string& robot, const std::string& run_folder) const {
    return takt("run " + robot + " --arm --duration 2s --allow-non-realtime --runtime-dir " + in("rt") + " --run-dir " +
                run_folder);
  }
};

TEST_F(OwnEngine, IsBuiltFromTheInstallationAloneAndDrivesTheRobot) {
  const Ended ended = run(robot_with(""), in("run"));
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_NE(ended.output.find("tracking"), std::string::npos) << ended.output;
  const std::string log = text_of(in("run/logs/takt-policy-host.log"));
  EXPECT_NE(log.find("24 values in, 16 steps of 6 out"), std::string::npos) << log;
  EXPECT_NE(log.find("engine: home pose; 0 threads of its own"), std::string::npos) << log;
  const Ended replayed = takt("replay " + in("run"));
  EXPECT_EQ(replayed.exit_code, 0) << replayed.output;

  const std::string robot = robot_with(", provider: cuda");
  const Ended checked = takt("config check " + robot);
  EXPECT_EQ(checked.exit_code, 65) << checked.output;
  EXPECT_NE(checked.output.find("home-pose has no provider cuda"), std::string::npos) << checked.output;
  EXPECT_EQ(run(robot, in("refused")).exit_code, 65);
}

}  // namespace
}  // namespace takt::cli
