// SPDX-License-Identifier: Apache-2.0
#include "simulation/scenario.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "config/checks.hpp"
#include "config/document.hpp"
#include "config/file_kind.hpp"
#include "config/reader.hpp"
#include "config/schema.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "simulation/device_table.hpp"

namespace takt::simulation {
namespace {

constexpr std::array<std::string_view, 1> kScenarioSchemas{"takt.scenario/1"};
constexpr std::array<std::string_view, 2> kAnchors{"start", "enabled"};
constexpr std::size_t kMostEvents = 256;
constexpr Duration kLongestRun = seconds(1'000'000);

// In the order of DeviceFault.
constexpr std::array<std::string_view, 6> kErrors{"over_temperature", "over_current", "over_voltage",
                                                  "under_voltage",    "encoder",      "overload"};

// By Target.
constexpr std::array<std::string_view, 4> kTargetKeys{"joint", "bus", "sensor", "body"};  // the body's is not written
constexpr std::array<std::string_view, 4> kTargetNouns{"a drive", "a bus", "a sensor", "the robot's body"};

using trouble::Row;
using trouble::row_of;

std::span<const Row> all_rows() {
  return trouble::rows(trouble::Place::plant);
}

// It needs a value: `delay: 3 ms` instead of `fault: delay`.
bool has_own_key(const Row& row) {
  return row.kind == static_cast<std::uint8_t>(FaultKind::error) || !row.dose.unit.empty();
}

std::string_view key_of(Target target) {
  return kTargetKeys[static_cast<std::size_t>(target)];
}
std::string_view noun_of(Target target) {
  return kTargetNouns[static_cast<std::size_t>(target)];
}

// `name` is known to be there.
template <class Item>
std::size_t index_in(const std::vector<Item>& items, std::string Item::*name_of, const std::string& name) {
  return static_cast<std::size_t>(std::ranges::find(items, name, name_of) - items.begin());
}

// Those of `fault: NAME`, or those that are keys themselves.
std::vector<std::string_view> names_of(bool with_own_key) {
  std::vector<std::string_view> names;
  for (const Row& row : all_rows())
    if (has_own_key(row) == with_own_key) names.push_back(row.name);
  return names;
}

// An event as written: what is absent is empty or zero.
struct Written {
  Duration at, lasts;
  std::string after, joint, bus, sensor, body, fault, error;
  std::vector<double> doses = std::vector<double>(all_rows().size());  // by kind
  config::Vector3 along{};
};

struct Names {
  std::vector<std::string_view> joints, buses, sensors;
};

void describe_event(config::Fields& fields, Written& event, const Names& names) {
  fields.duration({"at", "when it begins"}, event.at, {}, kLongestRun);
  event.after = kAnchors[0];
  fields.one_of({"after", "counted from the start, or from when the drive was first enabled", "start"}, event.after,
                kAnchors, "instant");
  fields.duration({"for", "how long it lasts", "to the end", true}, event.lasts, microseconds(1), kLongestRun);
  fields.one_of({"joint", "whose drive", "none", true}, event.joint, names.joints, "joint");
  fields.one_of({"bus", "which bus", "none", true}, event.bus, names.buses, "bus");
  fields.one_of({"sensor", "which sensor", "none", true}, event.sensor, names.sensors, "sensor");
  const std::vector<std::string_view> plain = names_of(false);
  fields.one_of({"fault", "what goes wrong", "none", true}, event.fault, plain, "fault");
  fields.one_of({"error", "what the drive reports", "none", true}, event.error, kErrors, "error");
  for (const Row& row : all_rows())
    if (!row.dose.unit.empty())
      fields.quantity({row.name, row.effect, "none", true}, event.doses[row.kind], row.dose.dimension(),
                      row.dose.range());
  fields.vector3({"along", "direction of the push, base frame", "none", true}, event.along, config::Dimension::none);
  fields.text({"body", "which body of the model is pushed or laden", "the tool, or the root", true}, event.body);
}

// Checks what no single key knows and translates.
class Translator {
 public:
  Translator(const config::RobotConfig& robot, config::Checker& checker) : robot_(robot), checker_(checker) {}

  FaultEvent translate(const Written& written, std::size_t index) {
    path_ = fmt::format("events[{}]", index);
    FaultEvent event;
    event.at = written.at;
    event.after_enabled = written.after == kAnchors[1];
    if (written.lasts.ns > 0) event.lasts = written.lasts;
    if (!find_kind(written, event) || !find_target(written, event)) return event;
    event.dose = written.doses[static_cast<std::size_t>(event.kind)];
    check_length(event);
    check_drive(event);
    check_body(written, event);
    return event;
  }

 private:
  bool require(bool holds, const std::string& key, const std::string& sentence) {
    checker_.require(holds, key.empty() ? path_ : path_ + "." + key, sentence);
    return holds;
  }
  static bool event_has(const Written& written, const Row& row) {
    return written.doses[row.kind] != 0 || (row.as<FaultKind>() == FaultKind::error && !written.error.empty());
  }
  bool find_kind(const Written& written, FaultEvent& event) {
    std::vector<FaultKind> kinds;
    for (const Row& row : all_rows())
      if (row.name == written.fault || event_has(written, row)) kinds.push_back(row.as<FaultKind>());
    if (!require(!kinds.empty(), "",
                 fmt::format("has no fault; write one of: fault, {}", fmt::join(names_of(true), ", "))))
      return false;
    event.kind = kinds.front();
    if (event.kind == FaultKind::error) {
      const auto error = std::ranges::find(kErrors, written.error) - kErrors.begin();
      event.error = static_cast<DeviceFault>(error);
    }
    return require(kinds.size() == 1, "", fmt::format("has {} faults at once; write an event for each", kinds.size()));
  }
  bool find_target(const Written& written, FaultEvent& event) {
    const std::array<const std::string*, 3> named{&written.joint, &written.bus, &written.sensor};
    event.strikes = Target::body;
    event.target_name = "body";
    for (std::size_t i = 0; i < named.size(); ++i) {
      if (named[i]->empty()) continue;
      if (!require(event.strikes == Target::body, std::string(kTargetKeys[i]),
                   fmt::format("the event names a {} already; keep one of the two", key_of(event.strikes))))
        return false;
      event.strikes = static_cast<Target>(i);
      event.target_name = *named[i];
    }
    if (!fits_target(event)) return false;
    if (event.strikes == Target::joint) event.target = index_in(robot_.joints, &config::Joint::name, event.target_name);
    if (event.strikes == Target::bus) event.target = index_in(robot_.buses, &config::Bus::name, event.target_name);
    if (event.strikes == Target::sensor)
      event.target = index_in(robot_.sensors, &config::Sensor::name, event.target_name);
    return true;
  }
  bool fits_target(const FaultEvent& event) {
    const Row& row = row_of(event.kind);
    if (std::ranges::find(row.strikes.words, key_of(event.strikes)) != row.strikes.words.end()) return true;
    if (event.strikes == Target::body)
      return require(false, "", "strikes nothing; write `joint: NAME`, `bus: NAME` or `sensor: NAME`");
    const std::string_view wanted = row.strikes.words.front();
    const std::string cure = wanted == key_of(Target::body) ? fmt::format("leave `{}` out", key_of(event.strikes))
                                                            : fmt::format("write `{}: NAME`", wanted);
    return require(
        false, std::string(has_own_key(row) ? row.name : "fault"),
        fmt::format("`{}` strikes {}, not {}; {}", row.name, row.strikes.told, noun_of(event.strikes), cure));
  }
  void check_length(const FaultEvent& event) {
    require(!event.lasts || row_of(event.kind).longest.ns > 0, "for",
            event.kind == FaultKind::error ? "a drive keeps its error until the host clears it; leave `for` out"
                                           : "a bus that is down stays down; leave `for` out");
  }
  void check_body(const Written& written, FaultEvent& event) {
    const double length = std::hypot(written.along[0], written.along[1], written.along[2]);
    const bool pushes = event.kind == FaultKind::push;
    require(pushes || length == 0, "along", "only a push has a direction; leave it out");
    require(!pushes || length > 0, "", "pushes nowhere; write `along: [x, y, z]`");
    require(pushes || event.kind == FaultKind::payload || written.body.empty(), "body",
            "only a push and a payload strike a body; leave it out");
    event.body = written.body;
    if (!written.body.empty()) event.target_name = written.body;
    for (std::size_t i = 0; pushes && length > 0 && i < 3; ++i) event.along[i] = written.along[i] / length;
    const bool has_body =
        robot_.model || (robot_.simulation && (robot_.simulation->cart_pole || robot_.simulation->mujoco));
    require(event.strikes != Target::body || has_body, "",
            fmt::format("`{}` strikes the robot's body, and devices on flywheels have none", row_of(event.kind).name));
  }
  void check_drive(const FaultEvent& event) {
    if (event.strikes != Target::joint) return;
    const config::Drive& drive = robot_.joints[event.target].drive;
    if (event.kind == FaultKind::error) {
      const std::unique_ptr<Device> device = make_device(drive, seconds(1));
      require(device && device->inject(event.error), "error",
              fmt::format("{}'s drive ({}{}) has no code for {}; choose another error", event.target_name,
                          config::name(drive.protocol), drive.variant.empty() ? "" : ", " + drive.variant,
                          kErrors[static_cast<std::size_t>(event.error)]));
    }
    if (event.kind == FaultKind::foreign_commands) {
      const auto rival = drivers::make_joint_driver(robot_, event.target);
      require(rival.has_value(), "fault", rival ? "" : rival.error());
    }
  }

  const config::RobotConfig& robot_;
  config::Checker& checker_;
  std::string path_;
};

}  // namespace

std::expected<Scenario, std::string> parse_scenario(std::string_view text, const std::string& name_for_messages,
                                                    const config::RobotConfig& robot) {
  config::Problems problems(name_for_messages);
  const config::Node root = config::read_document(text, config::Tags::refuse, problems);
  if (problems.empty()) config::expect_kind(root, kScenarioSchemas[0], name_for_messages, problems);
  if (!problems.empty()) return std::unexpected(problems.text());

  Names names{config::joint_names(robot), {}, {}};
  for (const config::Sensor& sensor : robot.sensors) names.sensors.emplace_back(sensor.name);
  for (const config::Bus& bus : robot.buses) names.buses.emplace_back(bus.name);
  std::vector<Written> written;
  config::Places places;
  config::Reader reader(root, "", problems, places);
  std::string schema(kScenarioSchemas[0]);
  reader.one_of({"schema", "format of this file"}, schema, kScenarioSchemas, "schema", {});
  reader.each({"events", "what goes wrong"}, written, kMostEvents,
              [&names](config::Fields& fields, Written& event) { describe_event(fields, event, names); });
  reader.finish();
  if (!problems.empty()) return std::unexpected(problems.text());

  config::Checker checker(places, problems);
  Translator translator(robot, checker);
  Scenario scenario;
  for (std::size_t i = 0; i < written.size(); ++i) scenario.events.push_back(translator.translate(written[i], i));
  if (!problems.empty()) return std::unexpected(problems.text());
  return scenario;
}

std::expected<Scenario, std::string> load_scenario(const std::string& path, const config::RobotConfig& robot) {
  const auto text = config::read_file(path);
  if (!text) return std::unexpected(text.error());
  return parse_scenario(*text, path, robot);
}

std::string text_of(const FaultEvent& event) {
  const Row& row = row_of(event.kind);
  std::string text(row.name);
  if (event.kind == FaultKind::error) text = kErrors[static_cast<std::size_t>(event.error)];
  if (row.dose.unit == "ms")
    text += " of " + config::format_duration({std::llround(event.dose)});
  else if (row.dose.unit == "share")
    text += fmt::format(" of {:.3g} %", 100 * event.dose);
  else if (row.dose.unit == "factor")
    text += fmt::format(" times {:g}", event.dose);
  else if (!row.dose.unit.empty())
    text += fmt::format(" of {:g} {}", event.dose, row.dose.unit);
  if (event.lasts) text += " for " + config::format_duration(*event.lasts);
  return text;
}

}  // namespace takt::simulation
