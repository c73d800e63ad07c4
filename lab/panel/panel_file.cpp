// SPDX-License-Identifier: Apache-2.0
#include "lab/panel/panel_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <set>
#include <tuple>
#include <utility>

#include "config/checks.hpp"
#include "config/document.hpp"
#include "config/file_kind.hpp"
#include "config/nearest.hpp"
#include "config/reader.hpp"

namespace takt::lab {
namespace {

using config::Dimension;
using config::Fields;

constexpr std::array<std::string_view, 2> kLinks{"newest", "repeat_last"};
constexpr Duration kLongest = seconds(3600);
constexpr std::size_t kMost = 1000;
constexpr std::int64_t kMostSeed = (std::int64_t{1} << 53) - 1;  // every reader keeps it exact

std::vector<std::string_view> perturbation_names() {
  std::vector<std::string_view> names;
  for (const trouble::Row& kind : evidence::perturbation_kinds()) names.push_back(kind.name);
  return names;
}

void describe_overrides(Fields& fields, const char* what, std::vector<config::Override>& overrides) {
  fields.each({"override", what, "[]"}, overrides, kMost, [](Fields& f, config::Override& one) {
    f.text({"key", "dotted path in the robot file"}, one.key);
    f.text({"value", "as one would write it there"}, one.value);
  });
}

void describe_base_velocity(Fields& fields, evidence::BaseVelocityTask& task) {
  std::vector<double> command(task.command.begin(), task.command.end());
  fields.quantities({"command", "m/s ahead, m/s to the left, rad/s to the left", "[0.5, 0, 0]"}, command,
                    Dimension::none, config::any_value(), {.low = 3, .high = 3, .of = "value"});
  for (std::size_t i = 0; i < task.command.size() && i < command.size(); ++i) task.command[i] = command[i];
  fields.duration({"until", "since the rollout's start; then the robot is to stand; 0 ms: it walks to the end", "0 ms"},
                  task.until, {}, kLongest);
  fields.quantity({"least_height", "share of the base's height at the start; lower, the robot has fallen", "0.6"},
                  task.least_height, Dimension::none, config::between(0, 1));
  fields.quantity({"most_tilt", "of the base from upright; further, the robot has fallen", "1 rad"}, task.most_tilt,
                  Dimension::angle, config::above(0, 3.2));
}

void describe_task(Fields& fields, PanelTask& task) {
  fields.choice({"task", "what the robot has to do"}, task.task, evidence::kTaskNames);
  fields.text({"robot", "robot file; a relative path starts at this file's folder"}, task.robot);
  fields.duration({"scored", "the last part of a rollout, by which it is judged"}, task.scored, milliseconds(1),
                  kLongest);
  fields.quantity({"bound", "success: root mean square error of the scored part at most this"}, task.bound_m,
                  Dimension::length, config::above(0));
  fields.integer({"modes", "of a sampling policy: which of so many an answer belongs to is drawn each time", "1"},
                 task.modes, 1, 16);
  fields.quantity(
      {"mode_spread", "how far the outer modes have drifted at a chunk's end, in units of its outputs", "0"},
      task.mode_spread, Dimension::none, config::between(0, 10));
  if (task.task == evidence::Task::base_velocity) describe_base_velocity(fields, task.base_velocity);
  describe_overrides(fields, "keys of the robot file said otherwise, for every method", task.overrides);
}

void describe_method(Fields& fields, PanelMethod& method) {
  fields.identifier({"name", "of the method in rows and tables"}, method.name);
  const evidence::BuiltInMethod* const built_in = evidence::find_built_in(method.name);
  if (built_in != nullptr) {
    method.description = built_in->description;
    method.method.built_in = built_in->which;
  }
  fields.text({"description", "in a sentence", "\"-\", or the built-in method's", true}, method.description);
  std::string link(kLinks[method.repeat_last ? 1 : 0]);
  fields.one_of({"link", "what stands between policy and executive", "newest"}, link, kLinks, "link");
  method.repeat_last = link == kLinks[1];
  describe_overrides(fields, "keys of the robot file said otherwise", method.overrides);
}

void describe_trouble(Fields& fields, PanelPerturbation& one, const Panel& panel) {
  fields.one_of({"kind", "name in the table of perturbations"}, one.kind, perturbation_names(), "perturbation");
  const trouble::Row* const kind = evidence::find_perturbation(one.kind);
  if (kind == nullptr) return;
  one.dose = kind->dose.moderate;
  one.from = panel.window_from;
  one.length = panel.window_length;
  fields.quantity({"dose", "in the perturbation's own unit", "the moderate one", true}, one.dose, Dimension::none,
                  config::between(kind->dose.least, kind->dose.most));
  fields.duration({"from", "start of its window", "window.from", true}, one.from, {}, kLongest);
  fields.duration({"for", "length of its window", "window.for", true}, one.length, {}, kLongest);
  fields.text({"body", "push and payload: which body of the robot's MJCF", "the tool, or the root", true}, one.body);
}

void describe_perturbation(Fields& fields, PanelPerturbation& one, const Panel& panel) {
  describe_trouble(fields, one, panel);
  if (evidence::find_perturbation(one.kind) == nullptr) return;
  fields.text({"load", "gpu_contention with --real-time: command that keeps the GPU busy", "none", true}, one.load);
  fields.references({"tasks", "which tasks it troubles; empty: every one", "[]"}, one.tasks, evidence::kTaskNames,
                    "task");
  fields.each({"with", "what acts besides, each in a window of its own", "[]"}, one.with, trouble::kTroubleCount,
              [&](Fields& f, PanelPerturbation& besides) { describe_trouble(f, besides, panel); });
}

void describe_claims(Fields& fields, Claims& claims) {
  fields.text({"conceptual", "why a method should help"}, claims.conceptual);
  fields.text({"systems", "which interface it changes"}, claims.systems);
  fields.text({"evidence", "which measurement would convince a sceptical builder"}, claims.evidence);
}

void describe_timing(Fields& fields, evidence::PolicyTiming& timing) {
  fields.duration({"inference", "mean time of one inference", "8 ms"}, timing.inference, {}, seconds(60));
  fields.quantity({"spread", "standard deviation of its logarithm; 0: always the mean", "0.25"}, timing.spread,
                  Dimension::none, config::between(0, 3));
  fields.duration({"publish", "inference ended to command in the mailbox", "60 us"}, timing.publish, {}, seconds(60));
}

void describe(Fields& fields, Panel& panel) {
  constexpr std::array kSchemas{kPanelSchema};
  std::string schema(kPanelSchema);
  fields.one_of({"schema", "format of this file"}, schema, kSchemas, "schema");
  fields.identifier({"panel", "name of the panel"}, panel.name);
  fields.duration({"duration", "of every rollout"}, panel.duration, milliseconds(100), kLongest);
  fields.section({"seeds", "the seed plan"}, [&](Fields& f) {
    f.integer({"first", "first seed", "1"}, panel.first_seed, 0, kMostSeed);
    f.integer({"count", "how many, one after the other"}, panel.seed_count, 1, 1'000'000);
  });
  fields.section({"policy", "when the policy answers", "{}"}, [&](Fields& f) { describe_timing(f, panel.timing); });
  fields.section({"window", "of perturbations that name none of their own", "{}"}, [&](Fields& f) {
    f.duration({"from", "since the rollout's start", "2 s"}, panel.window_from, {}, kLongest);
    f.duration({"for", "its length", "2 s"}, panel.window_length, {}, kLongest);
  });
  bool has_operator = false;
  Duration rearm_after;
  fields.optional_section({"operator", "the person who ends stops, the same for every method"}, has_operator,
                          [&](Fields& f) {
                            f.duration({"rearm_after",
                                        "from a stop or fault until the robot is armed again, if nothing "
                                        "blocks that"},
                                       rearm_after, {}, kLongest);
                          });
  if (has_operator) panel.rearm_after = rearm_after;
  bool claims = false;
  fields.optional_section({"claims", "what the panel is meant to show"}, claims,
                          [&](Fields& f) { describe_claims(f, panel.claims); });
  fields.each({"tasks", "what is to be done, and on which robot"}, panel.tasks, evidence::kTaskNames.size(),
              describe_task);
  fields.each({"methods", "what is compared"}, panel.methods, kMost, describe_method);
  fields.each({"perturbations", "what troubles the rollouts; `none` is the nominal one"}, panel.perturbations, kMost,
              [&](Fields& f, PanelPerturbation& one) { describe_perturbation(f, one, panel); });
}

bool is_lower_case(std::string_view name) {
  return std::ranges::none_of(name, [](char c) { return c >= 'A' && c <= 'Z'; });
}

// What every method has to meet alike: with it, a method would have a world of its own.
bool is_of_the_world(std::string_view key) {
  constexpr std::array<std::string_view, 3> kWorld{"simulation", "model", "control.period"};
  return std::ranges::any_of(kWorld, [key](std::string_view section) {
    return key == section || (key.starts_with(section) && key.substr(section.size()).starts_with('.'));
  });
}

// The built-in method that a mistyped one looks like, which would run the robot file as it is. Empty: none.
std::string_view built_in_meant(const PanelMethod& method) {
  if (evidence::find_built_in(method.name) != nullptr || !method.overrides.empty() || method.repeat_last) return {};
  std::vector<std::string_view> names;
  for (const evidence::BuiltInMethod& each : evidence::built_in_methods()) names.push_back(each.name);
  return config::nearest(method.name, names);
}

void check_tasks_and_methods(const Panel& panel, config::Checker& checker) {
  checker.require(is_lower_case(panel.name), "panel", "has capital letters; rows hold small ones only");
  std::set<evidence::Task> seen;
  for (std::size_t i = 0; i < panel.tasks.size(); ++i) {
    const std::string path = fmt::format("tasks[{}]", i);
    checker.require(seen.insert(panel.tasks[i].task).second, path + ".task", "is in the list twice; keep one");
    checker.require(panel.tasks[i].scored <= panel.duration, path + ".scored",
                    "is longer than the rollout's `duration`; shorten it");
  }
  for (std::size_t i = 0; i < panel.methods.size(); ++i) {
    const PanelMethod& method = panel.methods[i];
    const std::string name = fmt::format("methods[{}].name", i);
    checker.require(is_lower_case(method.name), name, "has capital letters; rows hold small ones only");
    checker.require(
        evidence::find_built_in(method.name) == nullptr || (method.overrides.empty() && !method.repeat_last), name,
        "is a built-in method's name, which takes no `override` and no `link`; choose another name");
    const std::string_view meant = built_in_meant(method);
    checker.require(
        meant.empty(), name,
        fmt::format("`{}` is no built-in method and overrides nothing; did you mean `{}`?", method.name, meant));
    for (std::size_t k = 0; k < method.overrides.size(); ++k)
      checker.require(!is_of_the_world(method.overrides[k].key), fmt::format("methods[{}].override[{}].key", i, k),
                      fmt::format("`{}` would give this method a world of its own; override it in the task",
                                  method.overrides[k].key));
  }
}

void check_trouble(const Panel& panel, const PanelPerturbation& one, const std::string& path,
                   config::Checker& checker) {
  checker.require(one.body.empty() || one.kind == "push" || one.kind == "payload", path + ".body",
                  "only `push` and `payload` strike a body; leave it out");
  checker.require(one.from + one.length <= panel.duration, path + ".kind",
                  "its window ends after the rollout's `duration`; move or shorten it");
}

void check_with(const Panel& panel, const PanelPerturbation& one, const std::string& path, config::Checker& checker) {
  std::set<std::string> kinds{one.kind};
  checker.require(one.with.empty() || one.kind != "none", path + ".with",
                  "`none` is the nominal rollout, which nothing troubles; name one of them as `kind`");
  for (std::size_t i = 0; i < one.with.size(); ++i) {
    const std::string place = fmt::format("{}.with[{}]", path, i);
    checker.require(one.with[i].kind != "none", place + ".kind", "`none` troubles nothing; leave it out");
    checker.require(kinds.insert(one.with[i].kind).second, place + ".kind",
                    "acts twice in one rollout; keep one of them");
    check_trouble(panel, one.with[i], place, checker);
  }
}

void check_perturbations(const Panel& panel, config::Checker& checker) {
  std::set<std::tuple<std::string, double, evidence::Task>> seen;
  for (std::size_t i = 0; i < panel.perturbations.size(); ++i) {
    const PanelPerturbation& one = panel.perturbations[i];
    const std::string path = fmt::format("perturbations[{}]", i);
    for (const PanelTask& task : panel.tasks)
      checker.require(!one.troubles(task.task) || seen.insert({one.name(), one.dose, task.task}).second, path + ".kind",
                      "is in the list twice with the same dose; keep one");
    for (const std::size_t wanted : one.tasks)
      checker.require(
          std::ranges::find(panel.tasks, static_cast<evidence::Task>(wanted), &PanelTask::task) != panel.tasks.end(),
          path + ".tasks", "names a task that this panel does not have; drop it, or add the task");
    checker.require(one.load.empty() || one.kind == "gpu_contention", path + ".load",
                    "only `gpu_contention` runs a command; leave it out");
    check_trouble(panel, one, path, checker);
    check_with(panel, one, path, checker);
  }
}

std::string beside(const std::string& file, const std::string& written) {
  return (std::filesystem::path(file).parent_path() / written).lexically_normal().string();
}

}  // namespace

std::string PanelPerturbation::name() const {
  std::string name = kind;
  for (const PanelPerturbation& besides : with) name += fmt::format("-with-{}-{:g}", besides.kind, besides.dose);
  return name;
}

evidence::Perturbation PanelPerturbation::resolved() const {
  evidence::Perturbation made{
      evidence::find_perturbation(kind)->as<evidence::Trouble>(), dose, from, length, load, body, {}};
  for (const PanelPerturbation& besides : with) made.with.push_back(besides.resolved());
  return made;
}

std::expected<Panel, std::string> load_panel(const std::string& path) {
  const auto text = config::read_file(path);
  if (!text) return std::unexpected(text.error());
  return panel_of(*text, path);
}

std::expected<Panel, std::string> panel_of(const std::string& text, const std::string& path) {
  config::Problems problems(path);
  const config::Node root = config::read_document(text, config::Tags::refuse, problems);
  if (problems.empty()) config::expect_kind(root, kPanelSchema, path, problems);
  if (!problems.empty()) return std::unexpected(problems.text());
  Panel panel;
  panel.file = path;
  panel.text = text;
  panel.sha256 = config::sha256_hex(text);
  config::Places places;
  config::Reader reader(root, "", problems, places);
  describe(reader, panel);
  reader.finish();
  if (problems.empty()) {
    config::Checker checker(places, problems);
    check_tasks_and_methods(panel, checker);
    check_perturbations(panel, checker);
  }
  if (!problems.empty()) return std::unexpected(problems.text());
  for (PanelTask& task : panel.tasks) task.robot = beside(path, task.robot);
  return panel;
}

}  // namespace takt::lab
