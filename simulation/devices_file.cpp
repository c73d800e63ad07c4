// SPDX-License-Identifier: Apache-2.0
#include "simulation/devices_file.hpp"

#include <array>

#include "config/checks.hpp"
#include "config/document.hpp"
#include "config/file_kind.hpp"
#include "config/reader.hpp"
#include "config/schema.hpp"
#include "executive/contract/joints.hpp"

namespace takt::simulation {
namespace {

constexpr std::array<std::string_view, 1> kDevicesSchemas{"takt.devices/1"};

void describe_device(config::Fields& fields, config::Joint& device, config::Words buses) {
  fields.identifier({"name", "unique name of the device"}, device.name);
  fields.reference({"bus", "name of the bus it is on"}, device.bus, buses, "bus");
  fields.section({"drive", "what it speaks"},
                 [&](config::Fields& f) { config::describe_drive(f, device.drive, config::JointKind::hinge); });
  fields.quantity({"inertia", "of its flywheel, beyond any gear"}, device.inertia, config::Dimension::inertia,
                  config::above(0, 1e4));
  fields.quantity({"position", "where it stands at the start, beyond any gear", "0 rad"}, device.home,
                  config::Dimension::angle, config::between(-1000, 1000));
}

void describe_devices(config::Fields& fields, config::RobotConfig& robot) {
  std::string schema(kDevicesSchemas[0]);
  fields.one_of({"schema", "format of this file"}, schema, kDevicesSchemas, "schema");
  fields.each({"buses", "CAN buses"}, robot.buses, kMaxBuses, config::describe_bus);
  std::vector<std::string_view> buses;
  for (const config::Bus& bus : robot.buses) buses.emplace_back(bus.name);
  fields.each({"devices", "drives, each on a flywheel"}, robot.joints, kMaxJoints,
              [&](config::Fields& f, config::Joint& device) { describe_device(f, device, buses); });
  fields.section({"simulation", "how the devices behave", "{}"},
                 [&](config::Fields& f) { config::describe_physics(f, *robot.simulation); });
}

}  // namespace

std::expected<config::RobotConfig, std::string> parse_devices(std::string_view text,
                                                              const std::string& name_for_messages) {
  config::Problems problems(name_for_messages);
  const config::Node root = config::read_document(text, config::Tags::refuse, problems);
  if (problems.empty()) config::expect_kind(root, kDevicesSchemas[0], name_for_messages, problems);
  if (!problems.empty()) return std::unexpected(problems.text());

  config::RobotConfig robot;
  robot.file = name_for_messages;
  robot.robot = "devices";
  robot.control.period = milliseconds(1);
  robot.simulation.emplace();
  config::Places places;
  config::Reader reader(root, "", problems, places);
  describe_devices(reader, robot);
  reader.finish();
  if (!problems.empty()) return std::unexpected(problems.text());
  config::Checker checker(places, problems, "devices");
  config::check_buses_and_ids(robot, checker);
  config::check_drives(robot, checker);
  if (!problems.empty()) return std::unexpected(problems.text());
  for (config::Joint& joint : robot.joints) joint.limits.torque = joint.drive.torque_range * joint.drive.gear_ratio;
  return robot;
}

std::expected<config::RobotConfig, std::string> load_devices(const std::string& path) {
  const auto text = config::read_file(path);
  if (!text) return std::unexpected(text.error());
  return parse_devices(*text, path);
}

}  // namespace takt::simulation
