// SPDX-License-Identifier: Apache-2.0
// make_otlp_files FOLDER: what a virtual robot's run tells OpenTelemetry, as the monitor writes it.
#include <filesystem>

#include "monitor/telemetry/otlp_exporter.hpp"
#include "tests/monitor/record/virtual_robot.hpp"

int main(int argc, char** argv) {
  using namespace takt;
  using namespace takt::monitor;
  if (argc != 2) return 64;
  std::filesystem::create_directories(argv[1]);
  config::RobotConfig config = demo_robot();
  config.otlp = config::Otlp{true, "", seconds(1)};
  VirtualRobot robot;
  auto exporter = OtlpExporter::start(config, {"arm6", "run", "ab", "1", 1'700'000'000'000'000'000}, argv[1], 1U << 30U,
                                      nullptr, MonoTime{1});
  if (!exporter) return 71;
  for (int tick = 0; tick < 3000; ++tick) {
    robot.policy_is_frozen = tick > 2500;  // ends in a stop
    robot.run(1);
    exporter->tick(robot.latest());
    exporter->export_if_due(robot.latest().header.now);
  }
  exporter->finish(robot.latest().header.now);
  return 0;
}
