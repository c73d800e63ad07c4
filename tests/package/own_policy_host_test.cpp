// Goal: with nothing but what takt-dev installs, somebody builds a policy host around an engine of their own, `takt
// run` starts it instead of takt-policy-host, and the run replays. Method: the installation is staged in a folder, the
// installed example is built against it alone, and runs the demo robot from a policy file that is no ONNX.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "tests/cli/shell.hpp"
#include "tests/process/patient_copy.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;
using test::Ended;

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

class OwnPolicyHost : public test::Shell {
 protected:
  void SetUp() override {
    for (const char* tool : {"cmake", "g++", "make", "pkg-config"})
      if (shell(std::string("command -v ") + tool).exit_code != 0)
        GTEST_SKIP() << "NOT TESTED: " << tool << " is not installed, so nothing can be built against takt-dev";
    const std::string stage = in("stage");
    const Ended installed = shell("cmake --install " TAKT_BUILD_DIR " --component dev --prefix " + stage);
    ASSERT_EQ(installed.exit_code, 0) << installed.output;
    const Ended built =
        shell("env -u CPATH -u CPLUS_INCLUDE_PATH cmake -G 'Unix Makefiles' -S " + stage +
              "/share/doc/takt-dev/examples/own-policy-host -B " + in("build") + " -DCMAKE_PREFIX_PATH=" + stage +
              " -DCMAKE_EXPORT_COMPILE_COMMANDS=ON && cmake --build " + in("build"));
    ASSERT_EQ(built.exit_code, 0) << built.output;
  }
  // The demo robot with a file of the engine's own in the place of the ONNX file, and some words replaced.
  [[nodiscard]] std::string robot_with(std::vector<std::pair<std::string, std::string>> changes) const {
    std::ofstream(in("engine")) << "home\n";
    changes.emplace_back(fs::absolute("config/arm6_reach.onnx"), in("engine"));
    const std::string robot = ::takt::test::patient_copy("config/arm6.yaml", directory());
    std::string text = text_of(robot);
    for (const auto& [from, to] : changes) {
      const auto at = text.find(from);
      if (at == std::string::npos) throw std::runtime_error(robot + " does not say " + from);
      text.replace(at, from.size(), to);
    }
    std::ofstream(robot) << text;
    return robot;
  }
  [[nodiscard]] Ended run(const std::string& robot, const std::string& run_folder) const {
    return takt("run " + robot + " --policy-host " + in("build/own-policy-host") +
                " --arm --duration 2s --allow-non-realtime --runtime-dir " + in("rt") + " --run-dir " + run_folder);
  }
};

TEST_F(OwnPolicyHost, IsBuiltFromTheInstallationAloneAndDrivesTheRobot) {
  for (const auto& entry : fs::directory_iterator(in("stage/lib/cmake/takt")))
    EXPECT_EQ(text_of(entry.path()).find(TAKT_SOURCE_DIR), std::string::npos) << entry.path();
  const std::string commands = text_of(in("build/compile_commands.json"));
  for (const char* ours : {TAKT_SOURCE_DIR, "-Wall", "-Werror", "-ffp-contract", "SPDLOG"})
    EXPECT_EQ(commands.find(ours), std::string::npos) << ours << " reaches the user in\n" << commands;

  const Ended ended = run(robot_with({}), in("run"));
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_NE(ended.output.find("tracking"), std::string::npos) << ended.output;
  EXPECT_NE(text_of(in("run/logs/takt-policy-host.log")).find("24 values in, 16 steps of 6 out"), std::string::npos)
      << text_of(in("run/logs/takt-policy-host.log"));
  const Ended replayed = takt("replay " + in("run"));
  EXPECT_EQ(replayed.exit_code, 0) << replayed.output;

  const Ended refused = run(robot_with({{"offset: home", "offset: zero"}}), in("refused"));
  EXPECT_EQ(refused.exit_code, 65) << refused.output;
  EXPECT_NE(refused.output.find("zeros are the home pose only"), std::string::npos) << refused.output;
}

}  // namespace
}  // namespace takt::cli
