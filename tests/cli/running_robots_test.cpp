// SPDX-License-Identifier: Apache-2.0
// Goal: a command without --runtime-dir finds the one robot that runs, says where it looked when there is none, and
// asks when there are several; folders that a robot left behind never count. Method: sockets in folders of the test's
// own: one served, several, one whose server died, one below a folder of another user. That a real robot is found is
// in cli_test.
#include "cli/running_robots.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "config/paths.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;

class RunningRobots : public testing::Test {
 protected:
  RunningRobots() { places_ = {directory_.path("run"), directory_.path("home")}; }
  static ipc::Descriptor serve(const std::string& folder, const std::string& name = {}) {
    fs::create_directories(folder);
    if (!name.empty()) std::ofstream(folder + "/executive.json") << R"({"robot": ")" << name << "\"}";
    return ipc::listen_at(config::executive_socket(folder)).value();
  }
  const test::TemporaryDirectory directory_;
  RobotPlaces places_;
};

TEST_F(RunningRobots, NoneSaysWhereItLooked) {
  fs::create_directories(places_.home + "/arm6");
  (void)serve(places_.home + "/left");  // closed at once: its socket stays behind, as after SIGKILL
  ASSERT_TRUE(fs::exists(config::executive_socket(places_.home + "/left")));
  const auto found = the_running_robot(places_, "");
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().exit_code, 69);
  EXPECT_EQ(found.error().sentence, "no robot runs: looked in " + places_.services + " and " + places_.home +
                                        "; start one with `takt run FILE`, or name its --runtime-dir");
}

TEST_F(RunningRobots, TheOneIsFoundWhereverItRuns) {
  for (const std::string& folder : {places_.services, places_.services + "/arm6", places_.home + "/arm6"}) {
    const ipc::Descriptor server = serve(folder, "arm6");
    const auto found = the_running_robot(places_, "");
    ASSERT_TRUE(found) << folder << ": " << found.error().sentence;
    EXPECT_EQ(found->runtime_directory, folder);
    EXPECT_EQ(found->name, "arm6");
  }
}

TEST_F(RunningRobots, OfSeveralNoneIsPicked) {
  const ipc::Descriptor service = serve(places_.services, "dual_arm12");
  const ipc::Descriptor own = serve(places_.home + "/arm6");
  const auto found = the_running_robot(places_, "");
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().exit_code, 64);
  EXPECT_EQ(found.error().sentence, "2 robots run here; which one?\n  dual_arm12: --runtime-dir " + places_.services +
                                        "\n  arm6: --runtime-dir " + places_.home + "/arm6");
  EXPECT_EQ(the_running_robot(places_, "arm6").value().runtime_directory, places_.home + "/arm6");
  EXPECT_EQ(the_running_robot(places_, "cart_pole").error().exit_code, 69);
}

TEST_F(RunningRobots, ANameFromAFileCannotMoveTheCursor) {
  const ipc::Descriptor server = serve(places_.home + "/arm6", "\\u001b[2Jarm");
  EXPECT_EQ(the_running_robot(places_, "").value().name, "\\x1b[2Jarm");
}

TEST_F(RunningRobots, AFolderOfSomebodyElseIsNeitherReadNorUsed) {
  if (geteuid() != 0) GTEST_SKIP() << "NOT TESTED: only root can give a folder away";
  const ipc::Descriptor server = serve(places_.home + "/arm6");
  ASSERT_TRUE(the_running_robot(places_, ""));
  ASSERT_EQ(chown(places_.home.c_str(), 4711, 4711), 0);
  EXPECT_FALSE(the_running_robot(places_, ""));
  fs::rename(places_.home, places_.home + "2");
  fs::create_symlink(places_.home + "2", places_.home);
  EXPECT_FALSE(the_running_robot(places_, "")) << "a link may lead anywhere";
}

TEST_F(RunningRobots, TheHomeIsMadeForItsUserAlone) {
  ASSERT_TRUE(make_runtime_home(places_.home));
  EXPECT_TRUE(make_runtime_home(places_.home)) << "a second time";
  struct stat status {};
  ASSERT_EQ(stat(places_.home.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0700U);
  std::ofstream(directory_.path("file"));
  EXPECT_FALSE(make_runtime_home(directory_.path("file/home")));
}

TEST_F(RunningRobots, TheRobotFileIsRememberedWhereItReallyLies) {
  EXPECT_EQ(remembered_robot_file(places_.home), "");
  std::ofstream(directory_.path("one.yaml")) << "robot: one\n";
  fs::create_symlink("one.yaml", directory_.path("link.yaml"));
  remember_robot_file(places_.home, directory_.path("link.yaml"));
  EXPECT_EQ(remembered_robot_file(places_.home), fs::canonical(directory_.path("one.yaml")));
  // As the units leave it; that link is not written through.
  fs::create_directories(directory_.path("deployment"));
  std::ofstream(directory_.path("deployment/robot.yaml")) << "robot: deployed\n";
  fs::create_directories(places_.services);
  fs::create_symlink(directory_.path("deployment"), places_.services + "/.robot");
  remember_robot_file(places_.services, directory_.path("one.yaml"));
  EXPECT_EQ(remembered_robot_file(places_.services), fs::canonical(directory_.path("deployment/robot.yaml")));
  EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(directory_.path("deployment/robot.yaml"))));
}

TEST(RuntimeHome, IsTheUsersOwn) {
  const char* const before = std::getenv("XDG_RUNTIME_DIR");
  const std::string kept = before == nullptr ? "" : before;
  setenv("XDG_RUNTIME_DIR", "/run/user/1000", 1);
  EXPECT_EQ(config::default_runtime_directory("arm6"), "/run/user/1000/takt/arm6");
  setenv("XDG_RUNTIME_DIR", "relative", 1);  // to be ignored, says the XDG Base Directory Specification
  EXPECT_TRUE(config::runtime_home().starts_with('/'));
  unsetenv("XDG_RUNTIME_DIR");
  const std::string home = config::runtime_home();
  const std::string user = std::to_string(geteuid());
  EXPECT_TRUE(geteuid() == 0 ? home == "/run/takt"
                             : home == "/run/user/" + user + "/takt" || home == "/tmp/takt-" + user)
      << home;
  if (!kept.empty()) setenv("XDG_RUNTIME_DIR", kept.c_str(), 1);
}

}  // namespace
}  // namespace takt::cli
