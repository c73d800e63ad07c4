// Goal: `takt margin` ends with its documented exit codes and its Bode plot is well-formed. Method: the real binary on
// the demo arm, without the task, whose rollouts have tests of their own.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/cli/shell.hpp"

namespace takt::cli {
namespace {

class MarginCli : public test::Shell {};

TEST_F(MarginCli, TheDemoArmsMarginsAgree) {
  const std::string picture = in("bode.svg");
  const test::Ended ended = takt("margin config/arm6.yaml --no-task --json --svg " + picture);
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  const auto json = nlohmann::json::parse(ended.output);
  EXPECT_TRUE(json["agrees"]);
  EXPECT_EQ(json["joints"].size(), 6U);
  EXPECT_TRUE(json["task"].is_null());
  const test::Ended parsed = shell(
      "python3 -c \"import sys, xml.dom.minidom as d; s = d.parse(sys.argv[1]); "
      "print(len(s.getElementsByTagName('polyline')))\" " +
      picture);
  EXPECT_EQ(parsed.output, "12\n") << "gain and phase of six joints";
}

TEST_F(MarginCli, BadInputEndsWithOneLine) {
  EXPECT_EQ(takt("margin").exit_code, 64);
  EXPECT_EQ(takt("margin config/arm6.yaml --seeds 10").exit_code, 64) << "too few to show anything";
  EXPECT_EQ(takt("margin no-such-robot.yaml").exit_code, 65);
  std::filesystem::copy("config/arm6_reach.onnx", in("arm6_reach.onnx"));
  std::ifstream whole("config/arm6.yaml");
  std::ofstream cut(in("real.yaml"));
  for (std::string line; std::getline(whole, line) && !line.starts_with("simulation:");) cut << line << "\n";
  cut.close();
  const test::Ended ended = takt("margin " + in("real.yaml"));
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_EQ(ended.output, "takt margin: " + in("real.yaml") + ": no `simulation`: there is no plant to measure on\n");
}

}  // namespace
}  // namespace takt::cli
