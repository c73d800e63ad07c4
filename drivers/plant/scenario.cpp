#include "drivers/plant/scenario.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "config/checks.hpp"
#include "config/document.hpp"
#include "config/reader.hpp"
#include "config/schema.hpp"
#include "drivers/plant/device_table.hpp"
#include "drivers/protocol_table.hpp"

namespace takt::plant {
namespace {

constexpr std::array<std::string_view, 1> kSchemas{"takt.scenario/1"};
constexpr std::array<std::string_view, 2> kAnchors{"start", "enabled"};
constexpr std::size_t kMostEvents = 256;
constexpr Duration kLongestRun = seconds(1'000'000);

// In the order of DeviceFault.
constexpr std::array<std::string_view, 6> kErrors{"over_temperature", "over_current", "over_voltage",
                                                  "under_voltage",    "encoder",      "overload"};

enum class Strikes : std::uint8_t { joint, bus, both };

struct Word {
  FaultKind kind;
  std::string_view name;  // error, delay and drop are keys of their own: they need a value
  Strikes strikes;
  bool has_length;
};
constexpr std::array kWords{
    Word{FaultKind::error, "error", Strikes::joint, false},
    Word{FaultKind::power_cycle, "power_cycle", Strikes::joint, true},
    Word{FaultKind::silent, "silent", Strikes::joint, true},
    Word{FaultKind::deaf, "deaf", Strikes::joint, true},
    Word{FaultKind::repeat, "repeat", Strikes::joint, true},
    Word{FaultKind::delay, "delay", Strikes::joint, true},
    Word{FaultKind::drop, "drop", Strikes::both, true},
    Word{FaultKind::foreign_commands, "foreign_commands", Strikes::joint, true},
    Word{FaultKind::error_passive, "error_passive", Strikes::bus, true},
    Word{FaultKind::bus_off, "bus_off", Strikes::bus, true},
    Word{FaultKind::down, "down", Strikes::bus, false},
    Word{FaultKind::babble, "babble", Strikes::bus, true},
};

bool has_own_key(FaultKind kind) {
  return kind == FaultKind::error || kind == FaultKind::delay || kind == FaultKind::drop;
}

const Word& word_of(FaultKind kind) {
  return kWords[static_cast<std::size_t>(kind)];
}

std::vector<std::string_view> plain_words() {
  std::vector<std::string_view> words;
  for (const Word& word : kWords)
    if (!has_own_key(word.kind)) words.push_back(word.name);
  return words;
}

// An event as written: what is absent is empty or zero.
struct Written {
  Duration at, lasts, delay;
  std::string after, joint, bus, fault, error;
  double drop = 0;
};

struct Names {
  std::vector<std::string_view> joints, buses;
};

void describe_event(config::Fields& fields, Written& event, const Names& names) {
  fields.duration({"at", "when it begins"}, event.at, {}, kLongestRun);
  event.after = kAnchors[0];
  fields.one_of({"after", "counted from the start, or from when the drive was first enabled", "start"}, event.after,
                kAnchors, "instant");
  fields.duration({"for", "how long it lasts", "to the end", true}, event.lasts, microseconds(1), kLongestRun);
  fields.one_of({"joint", "whose drive", "none", true}, event.joint, names.joints, "joint");
  fields.one_of({"bus", "which bus", "none", true}, event.bus, names.buses, "bus");
  const std::vector<std::string_view> words = plain_words();
  fields.one_of({"fault", "what goes wrong", "none", true}, event.fault, words, "fault");
  fields.one_of({"error", "what the drive reports", "none", true}, event.error, kErrors, "error");
  fields.duration({"delay", "answers arrive this much later", "none", true}, event.delay, microseconds(1), seconds(1));
  fields.quantity({"drop", "share of frames lost", "none", true}, event.drop, config::Dimension::none,
                  config::above(0, 1));
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
    if (!find_target(written, event) || !find_kind(written, event)) return event;
    event.delay = written.delay;
    event.share = written.drop;
    check_target(event);
    check_drive(event);
    return event;
  }

 private:
  bool require(bool holds, const std::string& key, const std::string& sentence) {
    checker_.require(holds, key.empty() ? path_ : path_ + "." + key, sentence);
    return holds;
  }
  bool find_target(const Written& written, FaultEvent& event) {
    event.on_bus = written.joint.empty();
    event.target_name = event.on_bus ? written.bus : written.joint;
    if (event.on_bus) {
      const auto found = std::ranges::find(robot_.buses, written.bus, &config::Bus::name);
      event.target = static_cast<std::size_t>(found - robot_.buses.begin());
    } else {
      const auto found = std::ranges::find(robot_.joints, written.joint, &config::Joint::name);
      event.target = static_cast<std::size_t>(found - robot_.joints.begin());
    }
    return require(!event.target_name.empty(), "", "strikes nothing; write `joint: NAME` or `bus: NAME`") &&
           require(event.on_bus || written.bus.empty(), "bus", "the event names a joint already; keep one of the two");
  }
  bool find_kind(const Written& written, FaultEvent& event) {
    std::vector<FaultKind> kinds;
    if (!written.fault.empty()) kinds.push_back(std::ranges::find(kWords, written.fault, &Word::name)->kind);
    if (!written.error.empty()) kinds.push_back(FaultKind::error);
    if (written.delay.ns > 0) kinds.push_back(FaultKind::delay);
    if (written.drop > 0) kinds.push_back(FaultKind::drop);
    if (!require(!kinds.empty(), "", "has no fault; write one of: fault, error, delay, drop")) return false;
    event.kind = kinds.front();
    if (event.kind == FaultKind::error) {
      const auto error = std::ranges::find(kErrors, written.error) - kErrors.begin();
      event.error = static_cast<DeviceFault>(error);
    }
    return require(kinds.size() == 1, "", fmt::format("has {} faults at once; write an event for each", kinds.size()));
  }
  void check_target(const FaultEvent& event) {
    const Word& word = word_of(event.kind);
    const std::string key = has_own_key(event.kind) ? std::string(word.name) : "fault";
    require(!event.on_bus || word.strikes != Strikes::joint, key,
            fmt::format("`{}` strikes a drive, not a bus; write `joint: NAME`", word.name));
    require(event.on_bus || word.strikes != Strikes::bus, key,
            fmt::format("`{}` strikes a bus, not a drive; write `bus: NAME`", word.name));
    require(!event.lasts || word.has_length, "for",
            event.kind == FaultKind::error ? "a drive keeps its error until the host clears it; leave `for` out"
                                           : "a bus that is down stays down; leave `for` out");
  }
  void check_drive(const FaultEvent& event) {
    if (event.on_bus) return;
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

  Names names{config::joint_names(robot), {}};
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
  if (event.kind == FaultKind::drop) text += fmt::format(" of {:.3g} %", 100 * event.share);
  if (event.lasts) text += " for " + config::format_duration(*event.lasts);
  return text;
}

}  // namespace takt::plant
