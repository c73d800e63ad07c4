// SPDX-License-Identifier: Apache-2.0
// legged_rl_deploy: one section `policy`; lists of joints stand in the policy's order, and joint_ids_map says the motor
// of each. What is done to a term's values, and to the outputs, stands step by step in its process_order; without one
// they are taken as they are. A command is a stick's way of -1..1 behind such steps.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string_view>
#include <utility>

#include "config/export_reader.hpp"
#include "config/exported_name.hpp"
#include "config/robot_config.hpp"

namespace takt::config {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

// Of one value: factor * x + offset, x held within lowest..highest.
struct Steps {
  double factor = 1, offset = 0, lowest = -kInfinite, highest = kInfinite;

  void clip(double low, double high) {
    if (factor == 0) return;
    double from = (low - offset) / factor, to = (high - offset) / factor;
    if (factor < 0) std::swap(from, to);
    lowest = std::clamp(from, lowest, highest);
    highest = std::clamp(to, lowest, highest);
  }
};

bool is_near(double a, double b) {
  return std::abs(a - b) <= 1e-9 * std::max({1.0, std::abs(a), std::abs(b)});
}

class LeggedRlReader : private ExportReader {
 public:
  explicit LeggedRlReader(Problems& problems) : ExportReader(problems) {}

  DeployFile read(const Node& root, const Node& policy) {
    DeployFile file;
    const Node* const map = policy.find("joint_ids_map");
    read_slots(numbers(policy, "joint_ids_map", 0, ""), map->place, "joint_ids_map", file);
    joints_ = file.slot.size();
    if (joints_ == 0) return file;
    read_period(policy, file);
    file.stiffness = in_robot_order(by_joint(policy, "stiffness"), file);
    file.damping = in_robot_order(by_joint(policy, "damping"), file);
    if (root.find("tau_max") != nullptr) file.torque = numbers(root, "tau_max", joints_, "joint_ids_map");
    read_action(policy, file);
    file.default_position = file.action_offset;
    read_commands(policy, file);
    if (const Node* const observations = need(policy, "observations", Node::Kind::map)) {
      read_terms(*observations, file);
      lay_out(*observations, file);
    }
    check_widths(policy, file);
    note_of_program(root, {"llc_config_file", "ll_dt", "clip_final_tau"}, file);
    note_of_program(policy, {"backend", "model_path"}, file);
    note_others(root, {"policy", "llc_config_file", "ll_dt", "clip_final_tau", "tau_max"}, "", file);
    note_others(policy,
                {"backend", "model_path", "input_dim", "output_dim", "policy_dt", "joint_ids_map", "stiffness",
                 "damping", "commands", "actions", "observations", "model"},
                "policy.", file);
    return file;
  }

 private:
  std::vector<double> by_joint(const Node& map, std::string_view key) {
    return numbers(map, key, joints_, "joint_ids_map");
  }

  void read_period(const Node& policy, DeployFile& file) {
    const double seconds = number(policy, "policy_dt").value_or(0);
    if (seconds > 0 && std::isfinite(seconds)) file.step_dt = {std::llround(seconds * 1e9)};
    if (file.step_dt.ns <= 0) problems_.add(policy.place, "policy_dt is not positive; write seconds");
  }

  // One value for all, or one each.
  std::vector<double> one_or(const Node& map, std::string_view key, std::size_t width) {
    const Node* const node = map.find(key);
    if (node != nullptr && node->kind == Node::Kind::scalar)
      return std::vector<double>(width, value_of(*node).value_or(0));
    std::vector<double> values = numbers(map, key, 0, "");
    if (values.size() == 1) values.resize(width, values.front());
    if (values.size() == width) return values;
    if (!values.empty())
      problems_.add(map.find(key)->place, fmt::format("`{}` has {} values for {}; write one for each, or one for all",
                                                      key, values.size(), width));
    return std::vector<double>(width, 0);
  }

  std::vector<Steps> steps_of(const Node* section, std::size_t width) {
    std::vector<Steps> steps(width);
    const Node* const order = section ? section->find("process_order") : nullptr;
    if (order == nullptr || order->kind == Node::Kind::null) return steps;
    if (order->kind != Node::Kind::sequence || order->items.size() > 16) {
      problems_.add(order->place, "process_order is no list of clip, scale and offset; export it again");
      return steps;
    }
    for (const Node& item : order->items) {
      if (item.text == "clip") {
        const std::vector<double> low = one_or(*section, "min", width), high = one_or(*section, "max", width);
        for (std::size_t i = 0; i < width; ++i) steps[i].clip(low[i], std::max(low[i], high[i]));
      } else if (item.text == "scale" || item.text == "offset") {
        const std::vector<double> values = one_or(*section, item.text, width);
        const bool scales = item.text == "scale";
        for (std::size_t i = 0; i < width; ++i) {
          if (scales) steps[i].factor *= values[i];
          steps[i].offset = scales ? steps[i].offset * values[i] : steps[i].offset + values[i];
        }
      } else {
        problems_.add(item.place, "process_order knows clip, scale and offset; export it again");
      }
    }
    return steps;
  }

  void read_action(const Node& policy, DeployFile& file) {
    const Node* const actions = policy.find("actions");
    const Node* const action = actions ? actions->find("JointPositionAction") : nullptr;
    const std::vector<Steps> steps = steps_of(action, joints_);
    for (const Steps& one : steps) {
      file.action_scale.push_back(one.factor);
      file.action_offset.push_back(one.offset);
    }
    if (std::ranges::any_of(steps, [](const Steps& one) { return std::isfinite(one.lowest); }))
      file.notes.emplace_back(
          "JointPositionAction: its clip is not carried over; set the joints' limits so that they cover it");
    if (actions == nullptr || actions->kind != Node::Kind::map) return;
    for (const Entry& entry : actions->entries)
      if (entry.key.text != "JointPositionAction")
        problems_.add(entry.key.place,
                      fmt::format("actions.{} ({}) is beside actions.JointPositionAction, and all outputs of a policy "
                                  "have one kind in a robot file; train with one kind",
                                  entry.key.text, joints_text(entry.value.find("joint_names"))));
  }

  // What a stick of -1..1 becomes.
  void read_commands(const Node& policy, DeployFile& file) {
    const Node* const commands = policy.find("commands");
    const Node* const velocity = commands ? commands->find("base_velocity") : nullptr;
    const std::vector<Steps> steps = steps_of(velocity && velocity->kind == Node::Kind::map ? velocity : nullptr, 3);
    std::size_t i = 0;
    for (const char* const name : {"lin_vel_x", "lin_vel_y", "ang_vel_z"}) {
      const Steps& one = steps[i++];
      const auto at = [&](double stick) {
        return one.factor * std::clamp(stick, one.lowest, one.highest) + one.offset;
      };
      file.command_ranges.push_back({name, std::minmax(at(-1), at(1))});
    }
    if (commands == nullptr || commands->kind != Node::Kind::map) return;
    for (const Entry& entry : commands->entries)
      if (entry.key.text != "base_velocity")
        file.notes.push_back(fmt::format("commands.{}: Takt does not know this command", entry.key.text));
  }

  // By name; 0: the program does not say.
  std::size_t width_of(std::string_view name, const Node* params) {
    static const std::map<std::string_view, std::size_t> widths{
        {"base_ang_vel_B", 3}, {"base_ang_vel_W", 3},    {"projected_gravity", 3}, {"eulerZYX_rpy", 3},
        {"roll_pitch", 2},     {"velocity_commands", 3}, {"gait_phase_2", 2}};
    if (const auto known = widths.find(name); known != widths.end()) return known->second;
    if (name == "joint_pos" || name == "joint_vel" || name == "last_action") return joints_;
    const char* const list = name == "constants" ? "vec" : name == "joystick_buttons" ? "keys" : nullptr;
    if (params == nullptr || params->kind != Node::Kind::map) return 0;
    if (list != nullptr)
      if (const Node* const node = params->find(list)) return node->items.size();
    const double dim = params->find("dim") != nullptr ? number(*params, "dim").value_or(0) : 0;
    return dim >= 1 && dim <= 65536 ? static_cast<std::size_t>(dim) : 0;
  }

  static std::string here(std::string_view name) {
    if (name == "base_ang_vel_B") return "base_ang_vel";
    if (name == "gait_phase_2") return "gait_phase";
    if (name == "joint_vel") return "joint_vel_rel";
    return std::string(name);
  }

  void read_params(const Node& params, DeployTerm& term, DeployFile& file) {
    if (term.name == "gait_phase") {
      const double seconds = params.find("cycle_time") != nullptr ? number(params, "cycle_time").value_or(0) : 0;
      if (seconds > 0) term.gait_period = {std::llround(seconds * 1e9)};
      return note_others(params, {"cycle_time"}, "gait_phase_2.params.", file);
    }
    if (term.name == "constants") {
      std::vector<double> values = numbers(params, "vec", 0, "");
      for (std::size_t i = 0; i < values.size() && i < term.scale.size(); ++i) values[i] *= term.scale[i];
      term.text = fmt::format("constant, values: [{}]", fmt::join(values, ", "));
    } else {
      for (const Entry& entry : params.entries)
        file.notes.push_back(
            fmt::format("{}.params.{}: of the program that gives these values", term.name, entry.key.text));
    }
  }

  // Clipped before it is scaled, as a robot file says it; `zero`: what the term subtracts from each value.
  void clip(const std::vector<Steps>& steps, const std::vector<double>& zero, DeployTerm& term, DeployFile& file) {
    const auto low = [&](std::size_t i) { return steps[i].lowest - zero[i]; };
    const auto high = [&](std::size_t i) { return steps[i].highest - zero[i]; };
    if (steps.empty() || (!std::isfinite(low(0)) && !std::isfinite(high(0)))) return;
    for (std::size_t i = 1; i < steps.size(); ++i)
      if (!is_near(low(i), low(0)) || !is_near(high(i), high(0))) {
        file.notes.push_back(fmt::format("clip of {}: it differs from value to value", term.name));
        return;
      }
    term.clip = {low(0), high(0)};
  }

  // Whether a clip is beyond all that a command may say.
  static bool is_within(const std::vector<Steps>& steps, const DeployTerm& term, const DeployFile& file) {
    if (term.name != "velocity_commands" || file.command_ranges.size() != steps.size()) return false;
    for (std::size_t i = 0; i < steps.size(); ++i)
      if (file.command_ranges[i].second.first < steps[i].lowest ||
          file.command_ranges[i].second.second > steps[i].highest)
        return false;
    return true;
  }

  void read_term(const Entry& entry, DeployFile& file) {
    if (const std::string why = why_no_name(entry.key.text); !why.empty())
      return problems_.add(entry.key.place, fmt::format("observation {}", why));
    const Node* const section = entry.value.kind == Node::Kind::map ? &entry.value : nullptr;
    const Node* const params = section ? section->find("params") : nullptr;
    DeployTerm term;
    term.name = here(entry.key.text);
    const std::size_t width = width_of(entry.key.text, params);
    term.is_unscaled = width == 0;
    const std::vector<Steps> steps = steps_of(section, width);
    std::vector<double> zero(width, 0);
    bool is_moved = false;
    for (std::size_t i = 0; i < width; ++i) {
      term.scale.push_back(steps[i].factor);
      if (steps[i].offset == 0) continue;
      is_moved = true;
      zero[i] = steps[i].factor == 0 ? 0 : -steps[i].offset / steps[i].factor;
    }
    if (is_moved && entry.key.text == "joint_pos") {
      term.name = "joint_pos_rel";
      file.default_position = zero;
    } else if (is_moved) {
      return problems_.add(entry.value.place,
                           fmt::format("the offset of `{}`: only joint positions have one in a robot file; put it into "
                                       "the network",
                                       entry.key.text));
    }
    if (!is_within(steps, term, file)) clip(steps, zero, term, file);
    if (params != nullptr && params->kind == Node::Kind::map) read_params(*params, term, file);
    if (section != nullptr)
      note_others(*section, {"process_order", "min", "max", "scale", "offset", "params"}, entry.key.text + ".", file);
    file.terms.push_back(std::move(term));
  }

  void read_terms(const Node& observations, DeployFile& file) {
    const Node* const terms = need(observations, "terms", Node::Kind::map);
    if (terms == nullptr) return;
    for (const Entry& entry : terms->entries) read_term(entry, file);
    const Node* const warmup = observations.find("history_warmup");
    if (warmup != nullptr && warmup->text == "zero")
      file.notes.emplace_back("history_warmup: zero: a history begins with its first value, repeated");
    note_others(observations, {"terms", "stack", "assemble", "layout", "history_warmup"}, "observations.", file);
  }

  void stack(const Node& of, DeployFile& file) {
    const Node* const length = of.find("length");
    const double instants = length ? value_of(*length).value_or(1) : 1;
    if (instants < 1 || instants > static_cast<double>(kMostHistory) || instants != std::floor(instants))
      return problems_.add(of.place, fmt::format("length of a history must be a whole number to {}", kMostHistory));
    for (DeployTerm& term : file.terms) {
      term.history = static_cast<std::uint32_t>(instants);
      if (!term.text.empty() && instants > 1) term.text += fmt::format(", history: {}", instants);
    }
    file.history_by_time = instants > 1;
    const Node* const order = of.find("order");
    file.newest_first = instants > 1 && order != nullptr && order->text == "newest_first";
  }

  // The terms in the order of a list of their names, all of them.
  void reorder(const Node& names, DeployFile& file) {
    std::vector<DeployTerm> ordered;
    for (const Node& name : names.items)
      for (DeployTerm& term : file.terms)
        if (here(name.text) == term.name || (name.text == "joint_pos" && term.name == "joint_pos_rel"))
          ordered.push_back(term);
    if (ordered.size() != file.terms.size() || names.items.size() != ordered.size())
      return problems_.add(
          names.place,
          "an input of some of the terms only: a robot file's policy reads all; export it without the others");
    file.terms = std::move(ordered);
  }

  void lay_out(const Node& observations, DeployFile& file) {
    if (const Node* const one = observations.find("stack"); one && one->kind == Node::Kind::map) stack(*one, file);
    const Node* const layout = observations.find("layout");
    const Node* const blocks = layout ? layout->find("blocks") : observations.find("assemble");
    if (blocks == nullptr || blocks->kind != Node::Kind::sequence || blocks->items.empty()) return;
    const Node& block = blocks->items.front();
    const Node* const kind = block.find("kind");
    const Node* const with_current = block.find("include_current");
    const bool is_history = kind != nullptr && kind->text == "history_frame";
    if (blocks->items.size() > 1 || (is_history && (with_current == nullptr || with_current->text != "true")))
      return problems_.add(blocks->place,
                           "an input of several blocks, or of the past alone: a robot file lays out one history of all "
                           "terms; export it so");
    if (const Node* const names = block.find("terms"); names && names->kind == Node::Kind::sequence)
      reorder(*names, file);
    if (kind == nullptr || is_history) stack(block, file);
  }

  void check_widths(const Node& policy, const DeployFile& file) {
    if (const Node* const model = policy.find("model"))
      if (const Node* const inputs = model->find("inputs"); inputs && inputs->items.size() > 1)
        problems_.add(inputs->place,
                      "a network of several inputs: a robot file's terms fill one; write the robot file by hand");
    double values = 0;
    for (const DeployTerm& term : file.terms) {
      if (term.is_unscaled) return;
      values += static_cast<double>(term.scale.size()) * term.history;
    }
    if (policy.find("input_dim") != nullptr)
      if (const double said = number(policy, "input_dim").value_or(0); said != values)
        problems_.add(policy.find("input_dim")->place,
                      fmt::format("`input_dim` is {}, the terms have {} values; export it again", said, values));
    if (policy.find("output_dim") != nullptr)
      if (const double said = number(policy, "output_dim").value_or(0); said != static_cast<double>(joints_))
        problems_.add(policy.find("output_dim")->place,
                      fmt::format("`output_dim` is {}, joint_ids_map has {} joints; export it again", said, joints_));
  }

  std::size_t joints_ = 0;
};

}  // namespace

const Node* policy_of_legged_rl(const Node& root) {
  const Node* const policy = root.find("policy");
  return policy != nullptr && policy->kind == Node::Kind::map && policy->find("joint_ids_map") != nullptr ? policy
                                                                                                          : nullptr;
}

DeployFile read_legged_rl_file(const Node& root, const Node& policy, Problems& problems) {
  return LeggedRlReader(problems).read(root, policy);
}

}  // namespace takt::config
