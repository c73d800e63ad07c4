// SPDX-License-Identifier: Apache-2.0
// Goal: takt-executive as a process: what it refuses and with which exit code, what it leaves behind, what the service
// manager hears, how it ends. Method: the real program on loopback buses, the drives simulated in this process.
#include "tests/executive/runtime/executive_process.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "config/load.hpp"
#include "drivers/bus/interface_claim.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/runtime/service_manager.hpp"
#include "tests/executive/runtime/holding_policy.hpp"
#include "tests/executive/runtime/simulated_drives.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::runtime::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

class ExecutiveTest : public testing::Test {
 protected:
  void connect_drives() { drives_ = std::make_unique<SimulatedDrives>(robot_, directory_.path()); }
  ExecutiveProcess start(std::vector<std::string> extra = {"--allow-non-realtime"}) const {
    std::vector<std::string> arguments{"--robot", robot_file_, "--runtime-dir", directory_.path()};
    arguments.insert(arguments.end(), extra.begin(), extra.end());
    return ExecutiveProcess(arguments);
  }
  [[nodiscard]] std::string socket_path() const { return config::executive_socket(directory_.path()); }
  [[nodiscard]] bool until(const std::function<bool(const StatusSnapshot&)>& holds) const {
    for (int i = 0; i < 2000; ++i) {
      if (const auto reply = ipc::ask(socket_path(), OperatorVerb::status, 5s); reply && holds(reply->status))
        return true;
      std::this_thread::sleep_for(5ms);
    }
    return false;
  }
  [[nodiscard]] bool until_ticking() const {
    return until([](const StatusSnapshot& status) { return status.ticks > kTicksUntilReady; });
  }
  bool arm() const {
    for (int i = 0; i < 1000; ++i) {
      if (const auto reply = ipc::ask(socket_path(), OperatorVerb::arm, 5s); reply && reply->done != 0) return true;
      std::this_thread::sleep_for(10ms);
    }
    return false;
  }

  // A robot that may move unrecorded: no monitor runs here.
  void need_no_recorder() {
    const config::Override changes[] = {{"record.recorder", "optional"}, {"policy.file", robot_.policy->file}};
    robot_ = config::with_overrides(robot_, changes).value();
    robot_file_ = directory_.path("arm6.yaml");
    std::ofstream(robot_file_) << robot_.resolved;
  }

  const takt::test::TemporaryDirectory directory_;
  std::string robot_file_ = "config/arm6.yaml";
  config::RobotConfig robot_ = config::load("config/arm6.yaml").value();
  std::unique_ptr<SimulatedDrives> drives_;
};

TEST_F(ExecutiveTest, AWrongCommandLineIsExit64) {
  ExecutiveProcess executive({"--no-such-option"});
  EXPECT_EQ(executive.wait(), 64);
}

TEST_F(ExecutiveTest, ABadConfigurationIsExit65AndNothingIsStarted) {
  const std::string file = directory_.path("bad.yaml");
  std::ofstream(file) << "schema: takt.robot/1\nrobot: x\nno_such_key: 1\n";
  connect_drives();
  ExecutiveProcess executive({"--robot", file, "--runtime-dir", directory_.path(), "--allow-non-realtime"});
  EXPECT_EQ(executive.wait(), 65);
  EXPECT_THAT(executive.errors(), HasSubstr("bad.yaml:3:1: "));
  EXPECT_FALSE(std::filesystem::exists(socket_path()));
  EXPECT_FALSE(std::filesystem::exists(directory_.path("executive.json")));
  EXPECT_EQ(drives_->frames(), 0U);
}

TEST_F(ExecutiveTest, AMissingBusIsExit69AndNamesIt) {
  ExecutiveProcess executive = start();
  EXPECT_EQ(executive.wait(), 69);
  EXPECT_THAT(executive.errors(), HasSubstr("can0"));
  EXPECT_FALSE(std::filesystem::exists(socket_path()));
}

TEST_F(ExecutiveTest, WithoutRealTimeRightsItRefusesWithExit71AndSaysHowToMendIt) {
  connect_drives();
  ExecutiveProcess executive({"--robot", "config/arm6.yaml", "--runtime-dir", directory_.path()}, Rights::none);
  EXPECT_EQ(executive.wait(), 71);
  EXPECT_THAT(executive.errors(), HasSubstr("--allow-non-realtime"));
  EXPECT_THAT(executive.errors(), HasSubstr("sched_fifo: "));
  EXPECT_THAT(executive.errors(), HasSubstr("RLIMIT_RTPRIO"));
  EXPECT_THAT(executive.errors(), HasSubstr("RLIMIT_MEMLOCK"));
  EXPECT_EQ(drives_->frames(), 0U) << "no tick ran";
}

TEST_F(ExecutiveTest, AllowedToRunWithoutRealTimeItSaysSoEverywhere) {
  connect_drives();
  ExecutiveProcess executive(
      {"--robot", "config/arm6.yaml", "--runtime-dir", directory_.path(), "--allow-non-realtime"}, Rights::none);
  ASSERT_TRUE(until_ticking());
  EXPECT_EQ(ipc::ask(socket_path(), OperatorVerb::status, 5s)->status.realtime, 0);
  const auto facts = nlohmann::json::parse(std::ifstream(directory_.path("executive.json")));
  EXPECT_EQ(facts.at("realtime"), false);
  EXPECT_EQ(facts.at("allow_non_realtime"), true);
  executive.signal(SIGTERM);
  EXPECT_EQ(executive.wait(), 0);
  EXPECT_THAT(executive.errors(), HasSubstr("WITHOUT real-time guarantees"));
}

TEST_F(ExecutiveTest, ItWritesDownWhatItIsAndRemovesItWhenItEnds) {
  connect_drives();
  ExecutiveProcess executive = start();
  ASSERT_TRUE(until_ticking());
  const auto facts = nlohmann::json::parse(std::ifstream(directory_.path("executive.json")));
  EXPECT_EQ(facts.at("schema"), "takt.executive/1");
  EXPECT_EQ(facts.at("pid"), executive.pid());
  EXPECT_EQ(facts.at("config_sha256"), robot_.sha256);
  EXPECT_EQ(facts.at("recorder"), "required");
  EXPECT_EQ(facts.at("binary_sha256"), config::sha256_hex(takt::test::text_of(TAKT_BIN_DIR "/takt-executive")));
  EXPECT_EQ(facts.at("buses").size(), robot_.buses.size());
  EXPECT_THAT(facts.at("buses")[0].at("description").get<std::string>(), HasSubstr("loopback"));
  std::set<std::string> steps;
  for (const auto& step : facts.at("realtime_steps")) steps.insert(step.at("name").get<std::string>());
  EXPECT_EQ(steps, (std::set<std::string>{"kernel", "allocator", "locked_memory", "cpu_dma_latency", "rt_throttling",
                                          "wake", "stack", "timer_slack", "affinity", "sched_fifo"}));
  executive.signal(SIGTERM);
  EXPECT_EQ(executive.wait(), 0);
  EXPECT_FALSE(std::filesystem::exists(socket_path()));
  EXPECT_FALSE(std::filesystem::exists(directory_.path("executive.json")));
}

TEST_F(ExecutiveTest, ASecondOneIsRefusedAndTheFirstIsUndisturbed) {
  connect_drives();
  ExecutiveProcess first = start();
  ASSERT_TRUE(until_ticking());
  ExecutiveProcess second = start();
  EXPECT_EQ(second.wait(), 71);
  EXPECT_THAT(second.errors(), HasSubstr("executive.sock"));
  EXPECT_TRUE(std::filesystem::exists(directory_.path("executive.json")));
  first.signal(SIGINT);
  EXPECT_EQ(first.wait(), 0);
}

// The interface of the first bus exists (it carries no CAN frames, which is found later), and this process has it.
TEST_F(ExecutiveTest, AnInterfaceThatSomebodyHasIsRefusedWhateverTheRuntimeDirectory) {
  std::string text = robot_.resolved;
  const std::string interface = "interface: " + robot_.buses[0].interface;
  ASSERT_NE(text.find(interface), std::string::npos);
  text.replace(text.find(interface), interface.size(), "interface: lo");
  const std::string policy = std::filesystem::path(robot_.policy->file).filename();
  std::filesystem::copy(robot_.policy->file, directory_.path(policy));
  robot_file_ = directory_.path("arm6.yaml");
  std::ofstream(robot_file_) << text;
  std::optional claim = drivers::InterfaceClaim::make("lo");
  ASSERT_TRUE(*claim) << claim->error();
  ExecutiveProcess refused = start();
  EXPECT_EQ(refused.wait(), 71);
  EXPECT_THAT(refused.errors(), HasSubstr("lo: another process of Takt (pid " + std::to_string(getpid()) + ", uid "));
  claim.reset();
  ExecutiveProcess later = start();
  EXPECT_EQ(later.wait(), 69) << later.errors();
}

TEST_F(ExecutiveTest, SigtermWhileTrackingStopsTheRobotAndDisablesItsDrives) {
  need_no_recorder();
  connect_drives();
  ExecutiveProcess executive = start();
  ASSERT_TRUE(until_ticking());
  Hello hello;
  hello.role = Role::policy;
  hello.config_hash = robot_.hash;
  hello.policy_hash = config::policy_hash(robot_.policy->file).value();
  hello.joint_names_hash = config::joint_names_hash(robot_);
  hello.joint_count = static_cast<std::uint32_t>(robot_.joints.size());
  hello.step_count = robot_.policy->steps;
  const auto lease = ipc::attach(socket_path(), hello, 5s);
  ASSERT_TRUE(lease) << lease.error();
  HoldingPolicy policy(lease->descriptors[0].get(), lease->descriptors[1].get(), hello.policy_hash,
                       static_cast<std::uint16_t>(robot_.policy->steps), robot_.policy->step_period);
  ASSERT_TRUE(ipc::acknowledge(*lease));
  policy.start();
  ASSERT_TRUE(arm());
  ASSERT_TRUE(until([](const StatusSnapshot& status) { return status.tick.mode == Mode::tracking; }));
  EXPECT_TRUE(drives_->all_enabled());

  executive.signal(SIGTERM);
  EXPECT_EQ(executive.wait(), 0);
  EXPECT_THAT(executive.errors(), HasSubstr("tracking -> damped_stop: shutdown"));
  for (int i = 0; i < 1000 && !drives_->all_disabled(); ++i) std::this_thread::sleep_for(1ms);
  EXPECT_TRUE(drives_->all_disabled());
}

TEST_F(ExecutiveTest, TheServiceManagerHearsReadyPingsAndStopping) {
  connect_drives();
  const std::string path = directory_.path("notify");
  const ipc::Descriptor notify(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(bind(notify.get(), reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  const timeval patience{10, 0};
  setsockopt(notify.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  const auto hear = [&](const std::string& wanted) {
    char text[256];
    ssize_t size = 0;
    while ((size = recv(notify.get(), text, sizeof text, 0)) > 0) {
      if (std::string(text, static_cast<std::size_t>(size)) == wanted) return true;
    }
    return false;
  };
  setenv("NOTIFY_SOCKET", path.c_str(), 1);
  setenv("WATCHDOG_USEC", "90000", 1);
  ExecutiveProcess executive = start();
  unsetenv("NOTIFY_SOCKET");
  unsetenv("WATCHDOG_USEC");
  EXPECT_TRUE(hear("READY=1"));
  EXPECT_TRUE(hear("WATCHDOG=1"));
  EXPECT_TRUE(hear("WATCHDOG=1"));
  executive.signal(SIGTERM);
  EXPECT_TRUE(hear("STOPPING=1"));
  EXPECT_EQ(executive.wait(), 0);
}

TEST_F(ExecutiveTest, LosingTheDrivesIsNoReasonToEnd) {
  connect_drives();
  ExecutiveProcess executive = start();
  ASSERT_TRUE(until_ticking());
  drives_->stop();
  EXPECT_TRUE(until([](const StatusSnapshot& status) { return status.tick.buses[0].state == BusState::down; }));
  EXPECT_FALSE(executive.has_ended());
  executive.signal(SIGTERM);
  EXPECT_EQ(executive.wait(), 0);
}

}  // namespace
}  // namespace takt::runtime::test
