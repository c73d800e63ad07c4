// SPDX-License-Identifier: Apache-2.0
#include "simulation/scenario.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "config/checks.hpp"
#include "config/document.hpp"
#include "config/reader.hpp"
#include "config/schema.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "simulation/device_table.hpp"

namespace takt::simulation {
namespace {

constexpr std::array<std::string_view, 1> kSchemas{"takt.scenario/1"};
constexpr std::array<std::string_view, 2> kAnchors{"start", "enabled"};
constexpr std::size_t kMostEvents = 256;
constexpr Duration kLongestRun = seconds(1'000'000);

// In the order of DeviceFault.
constexpr std::array<std::string_view, 6> kErrors{"over_temperature", "over_current", "over_voltage",
                                                  "under_voltage",    "encoder",      "overload"};

// By Target.
constexpr std::array<std::string_view, 4> kTargetKeys{"joint", "bus", "sensor", ""};
constexpr std::array<std::string_view, 4> kTargetNouns{"a drive", "a bus", "a sensor", "the robot's body"};

using Targets = std::uint8_t;  // one bit per Target
constexpr Targets only(Target target) {
  return static_cast<Targets>(1U << static_cast<unsigned>(target));
}
constexpr Targets kJoint = only(Target::joint), kBus = only(Target::bus), kSensor = only(Target::sensor),
                  kBody = only(Target::body);

struct Word {
  FaultKind kind;
  std::string_view name;
  Targets strikes;
  bool has_own_key;  // it needs a value: `delay: 3 ms` instead of `fault: delay`
  bool has_length;
};
constexpr std::array kWords{
    Word{FaultKind::error, "error", kJoint, true, false},
    Word{FaultKind::power_cycle, "power_cycle", kJoint, false, true},
    Word{FaultKind::silent, "silent", kJoint, false, true},
    Word{FaultKind::deaf, "deaf", kJoint, false, true},
    Word{FaultKind::repeat, "repeat", kJoint, false, true},
    Word{FaultKind::delay, "delay", kJoint, true, true},
    Word{FaultKind::drop, "drop", kJoint | kBus | kSensor, true, true},
    Word{FaultKind::foreign_commands, "foreign_commands", kJoint, false, true},
    Word{FaultKind::error_passive, "error_passive", kBus, false, true},
    Word{FaultKind::bus_off, "bus_off", kBus, false, true},
    Word{FaultKind::down, "down", kBus, false, false},
    Word{FaultKind::babble, "babble", kBus, false, true},
    Word{FaultKind::frozen_position, "frozen_position", kJoint, false, true},
    Word{FaultKind::reversed, "reversed", kJoint, false, true},
    Word{FaultKind::wrap, "wrap", kJoint, false, true},
    Word{FaultKind::jump, "jump", kJoint, true, true},
    Word{FaultKind::scale, "scale", kJoint, true, true},
    Word{FaultKind::freeze, "freeze", kJoint | kSensor, false, true},
    Word{FaultKind::burst, "burst", kSensor, true, true},
    Word{FaultKind::lies, "lies", kSensor, true, true},
    Word{FaultKind::push, "push", kBody, true, true},
    Word{FaultKind::payload, "payload", kBody, true, true},
    Word{FaultKind::friction, "friction", kBody, true, true},
};

const Word& word_of(FaultKind kind) {
  return kWords[static_cast<std::size_t>(kind)];
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

std::vector<std::string_view> plain_words() {
  std::vector<std::string_view> words;
  for (const Word& word : kWords)
    if (!word.has_own_key) words.push_back(word.name);
  return words;
}

// An event as written: what is absent is empty or zero.
struct Written {
  Duration at, lasts, delay, burst;
  std::string after, joint, bus, sensor, body, fault, error;
  double drop = 0, lies = 0, jump = 0, scale = 0, push = 0, payload = 0, friction = 0;
  config::Vector3 along{};
};

struct Names {
  std::vector<std::string_view> joints, buses, sensors;
};

void describe_body(config::Fields& fields, Written& event) {
  fields.quantity({"push", "force at the tool", "none", true}, event.push, config::Dimension::force,
                  config::above(0, 10'000));
  fields.vector3({"along", "direction of the push, base frame", "none", true}, event.along, config::Dimension::none);
  fields.quantity({"payload", "point mass at the tool", "none", true}, event.payload, config::Dimension::mass,
                  config::above(0, 1000));
  fields.text({"body", "which body of the model is pushed or laden", "the tool, or the root", true}, event.body);
  fields.quantity({"friction", "factor on the joints' friction", "none", true}, event.friction, config::Dimension::none,
                  config::above(0, 1000));
}

void describe_event(config::Fields& fields, Written& event, const Names& names) {
  fields.duration({"at", "when it begins"}, event.at, {}, kLongestRun);
  event.after = kAnchors[0];
  fields.one_of({"after", "counted from the start, or from when the drive was first enabled", "start"}, event.after,
                kAnchors, "instant");
  fields.duration({"for", "how long it lasts", "to the end", true}, event.lasts, microseconds(1), kLongestRun);
  fields.one_of({"joint", "whose drive", "none", true}, event.joint, names.joints, "joint");
  fields.one_of({"bus", "which bus", "none", true}, event.bus, names.buses, "bus");
  fields.one_of({"sensor", "which sensor", "none", true}, event.sensor, names.sensors, "sensor");
  const std::vector<std::string_view> words = plain_words();
  fields.one_of({"fault", "what goes wrong", "none", true}, event.fault, words, "fault");
  fields.one_of({"error", "what the drive reports", "none", true}, event.error, kErrors, "error");
  fields.duration({"delay", "answers arrive this much later", "none", true}, event.delay, microseconds(1), seconds(1));
  fields.quantity({"drop", "share of frames or samples lost", "none", true}, event.drop, config::Dimension::none,
                  config::above(0, 1));
  fields.duration({"burst", "samples are held back and delivered together, this often", "none", true}, event.burst,
                  milliseconds(1), seconds(10));
  fields.quantity({"lies", "share of samples that say the opposite", "none", true}, event.lies, config::Dimension::none,
                  config::above(0, 1));
  fields.quantity({"jump", "the position that the drive says is off by this", "none", true}, event.jump,
                  config::Dimension::angle, config::between(-100, 100));
  fields.quantity({"scale", "the position that the drive says goes this many times as far", "none", true}, event.scale,
                  config::Dimension::none, config::above(0, 100));
  describe_body(fields, event);
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
    event.delay = event.kind == FaultKind::burst ? written.burst : written.delay;
    event.share = written.drop + written.lies;                                                        // one of them
    event.amount = written.jump + written.scale + written.push + written.payload + written.friction;  // one of them
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
  bool find_kind(const Written& written, FaultEvent& event) {
    std::vector<FaultKind> kinds;
    if (!written.fault.empty()) kinds.push_back(std::ranges::find(kWords, written.fault, &Word::name)->kind);
    if (!written.error.empty()) kinds.push_back(FaultKind::error);
    if (written.delay.ns > 0) kinds.push_back(FaultKind::delay);
    if (written.drop > 0) kinds.push_back(FaultKind::drop);
    if (written.burst.ns > 0) kinds.push_back(FaultKind::burst);
    if (written.lies > 0) kinds.push_back(FaultKind::lies);
    if (written.jump != 0) kinds.push_back(FaultKind::jump);
    if (written.scale > 0) kinds.push_back(FaultKind::scale);
    if (written.push > 0) kinds.push_back(FaultKind::push);
    if (written.payload > 0) kinds.push_back(FaultKind::payload);
    if (written.friction > 0) kinds.push_back(FaultKind::friction);
    if (!require(
            !kinds.empty(), "",
            "has no fault; write one of: fault, error, delay, drop, burst, lies, jump, scale, push, payload, friction"))
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
    const Word& word = word_of(event.kind);
    if ((word.strikes & only(event.strikes)) != 0) return true;
    if (event.strikes == Target::body)
      return require(false, "", "strikes nothing; write `joint: NAME`, `bus: NAME` or `sensor: NAME`");
    const std::string key(word.has_own_key ? word.name : "fault");
    const auto wanted = static_cast<Target>(std::countr_zero(word.strikes));
    const std::string mend = wanted == Target::body ? fmt::format("leave `{}` out", key_of(event.strikes))
                                                    : fmt::format("write `{}: NAME`", key_of(wanted));
    return require(
        false, key,
        fmt::format("`{}` strikes {}, not {}; {}", word.name, noun_of(wanted), noun_of(event.strikes), mend));
  }
  void check_length(const FaultEvent& event) {
    require(!event.lasts || word_of(event.kind).has_length, "for",
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
            fmt::format("`{}` strikes the robot's body, and devices on flywheels have none", word_of(event.kind).name));
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
  if (problems.empty() && root.kind != config::Node::Kind::map)
    problems.add(root.place, "holds no scenario; begin with `schema: takt.scenario/1`");
  if (!problems.empty()) return std::unexpected(problems.text());

  Names names{config::joint_names(robot), {}, {}};
  for (const config::Sensor& sensor : robot.sensors) names.sensors.emplace_back(sensor.name);
  for (const config::Bus& bus : robot.buses) names.buses.emplace_back(bus.name);
  std::vector<Written> written;
  config::Places places;
  config::Reader reader(root, "", problems, places);
  std::string schema(kSchemas[0]);
  reader.one_of({"schema", "format of this file"}, schema, kSchemas, "schema", {});
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
  std::string text(word_of(event.kind).name);
  if (event.kind == FaultKind::error) text = kErrors[static_cast<std::size_t>(event.error)];
  if (event.kind == FaultKind::delay) text += " of " + config::format_duration(event.delay);
  if (event.kind == FaultKind::burst) text += " of " + config::format_duration(event.delay);
  if (event.kind == FaultKind::jump) text += fmt::format(" of {:g} rad", event.amount);
  if (event.kind == FaultKind::scale) text += fmt::format(" times {:g}", event.amount);
  if (event.kind == FaultKind::push) text += fmt::format(" of {:g} N", event.amount);
  if (event.kind == FaultKind::payload) text += fmt::format(" of {:g} kg", event.amount);
  if (event.kind == FaultKind::friction) text += fmt::format(" times {:g}", event.amount);
  if (event.kind == FaultKind::drop || event.kind == FaultKind::lies)
    text += fmt::format(" of {:.3g} %", 100 * event.share);
  if (event.lasts) text += " for " + config::format_duration(*event.lasts);
  return text;
}

}  // namespace takt::simulation
