// SPDX-License-Identifier: Apache-2.0
// Goal: takt doctor and takt bus up read the robot file, say what they found or would do, and end as documented.
// Method: the real binary on whatever machine this is; only what holds on every machine is expected.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/cli/shell.hpp"
#include "tests/support/files.hpp"

namespace takt::cli {
namespace {

using test::Ended;

class Machine : public test::Shell {};

TEST_F(Machine, TheDoctorJudgesThisMachine) {
  const Ended quick = takt("doctor --for 0 --json");
  const auto without_robot = nlohmann::json::parse(quick.output);
  EXPECT_EQ(without_robot["schema"], "takt.doctor/1");
  EXPECT_TRUE(without_robot["wakeup"].is_null());
  EXPECT_EQ(quick.exit_code, without_robot["verdict"] == "fail" ? 1 : 0);

  const Ended whole = takt("doctor --robot config/dual_arm12.yaml --for 0.1 --json");
  const auto json = nlohmann::json::parse(whole.output);
  EXPECT_EQ(json["wakeup"]["samples"], 100);
  EXPECT_TRUE(json["wakeup"]["held_awake"].is_boolean());
  for (const char* count : {"smis", "stolen_ms"})
    EXPECT_TRUE(json["wakeup"].at(count).is_null() || json["wakeup"].at(count).is_number()) << count;
  int interfaces = 0;
  for (const auto& finding : json["findings"]) {
    interfaces += finding["check"].get<std::string>().starts_with("can ") ? 1 : 0;
    EXPECT_EQ(finding["correct"] == "", finding["verdict"] == "ok") << finding;
  }
  EXPECT_EQ(interfaces, 4);
  const Ended text = takt("doctor --robot config/arm6.yaml --for 50ms --load");
  EXPECT_NE(text.output.find("by the doctor's own load"), std::string::npos) << text.output;
  EXPECT_NE(text.output.find("wake-ups"), std::string::npos);
  EXPECT_NE(text.output.find("for hard real time"), std::string::npos) << text.output;
}

TEST_F(Machine, TheDoctorRefusesWhatItCannotRead) {
  EXPECT_EQ(takt("doctor --robot no-such-robot.yaml").exit_code, 65);
  EXPECT_EQ(takt("doctor --for -1").exit_code, 64);
}

TEST_F(Machine, InterfacesAreSetAsTheRobotFileSays) {
  const Ended all = takt("bus up --robot config/dual_arm12.yaml --dry-run");
  EXPECT_EQ(all.exit_code, 0) << all.output;
  for (const char* line : {"ip link set can0 type can bitrate 1000000\n", "ip link set can0 type can restart-ms 100\n",
                           "dbitrate 5000000 fd on\n", "ip link set can3 txqueuelen 32 up\n"})
    EXPECT_NE(all.output.find(line), std::string::npos) << line << " is missing in\n" << all.output;
  EXPECT_EQ(takt("bus up --robot config/arm6.yaml --interface can7 --dry-run").exit_code, 64);
  std::string text = takt::test::text_of("config/dual_arm12.yaml");
  const std::string rate = "data_bitrate: 5 Mbit/s";
  ASSERT_NE(text.find(rate), std::string::npos);
  text.replace(text.find(rate), rate.size(),
               rate + ", sample_point: 0.875, sjw: 8, data_sample_point: 0.666, data_sjw: 2");
  const std::string timed = testing::TempDir() + "timed_arm.yaml";
  std::ofstream(timed) << text;
  const Ended exact = takt("bus up --dry-run --robot " + timed);
  EXPECT_NE(exact.output.find("bitrate 1000000 sample-point 0.875 sjw 8 dbitrate 5000000 dsample-point 0.666 dsjw 2 "
                              "fd on\n"),
            std::string::npos)
      << exact.output;
  EXPECT_EQ(takt("bus up --robot no-such-robot.yaml").exit_code, 65);
}

}  // namespace
}  // namespace takt::cli
