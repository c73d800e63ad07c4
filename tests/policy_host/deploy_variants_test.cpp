// SPDX-License-Identifier: Apache-2.0
// Goal: a deploy.yaml of any legal form shows the network what its training showed it, and moves the joints that the
// training moved. Method: 27 variants (3 motor maps x 3 choices of joints x 3 ways to write values and histories),
// each imported, read and played over six observations, against an implementation written here from what
// unitree_rl_lab's deployment does (isaaclab/manager: clip, then scale unless scale_first; a history per term, or all
// terms of an instant with use_gym_history), to 1e-6.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "config/deploy_import.hpp"
#include "config/load.hpp"
#include "policy_host/chunk_builder.hpp"
#include "policy_host/observation_builder.hpp"
#include "tests/policy_host/imported_robot.hpp"

namespace takt::policy_host {
namespace {

using Numbers = std::vector<double>;
using Indices = std::vector<std::size_t>;

constexpr std::size_t kJoints = 4;

struct Term {
  const char* name;
  Numbers scale;  // empty: null
  std::size_t history;
  Indices joints{};  // of the policy; empty: all
  double clip = 0;   // plus and minus; 0: none
  bool scale_first = false;
};

struct Variant {
  Indices motors;  // joint_ids_map
  std::vector<Term> terms;
  Indices moved{};  // joint_ids of the action; empty: all
  Numbers action_scale, offset;
  bool by_time = false;
};

const Numbers kDefault{0.1, -0.2, 0.3, -0.4};  // by the policy's joints

Numbers some(std::size_t count, double first) {
  Numbers numbers;
  for (std::size_t i = 0; i < count; ++i) numbers.push_back(first + 0.25 * static_cast<double>(i));
  return numbers;
}

Variant variant(std::size_t map, std::size_t choice, std::size_t values) {
  Variant one;
  one.motors = std::vector<Indices>{{0, 1, 2, 3}, {2, 0, 3, 1}, {6, 1, 9, 4}}[map];
  const Indices watched = choice == 0 ? Indices{} : Indices{3, 1, 2};
  if (choice == 2) one.moved = {2, 0};
  const std::size_t outputs = one.moved.empty() ? kJoints : one.moved.size();
  const std::size_t width = watched.empty() ? kJoints : watched.size();
  one.by_time = values == 1;
  const bool nulls = values == 1;
  one.terms = {{"joint_pos_rel", nulls ? Numbers{} : some(width, 0.5), one.by_time ? 3U : 2U, watched},
               {"joint_vel_rel", Numbers(kJoints, 0.05), one.by_time ? 3U : 4U},
               {"last_action", nulls ? Numbers{} : some(outputs, 1), one.by_time ? 3U : 1U}};
  if (values == 2) {
    one.terms[0].clip = 0.2;
    one.terms[1].clip = 0.1;
    one.terms[1].scale_first = true;
  }
  one.action_scale = nulls ? Numbers{} : some(outputs, 0.25);
  one.offset = values == 2 ? Numbers{} : some(outputs, -0.3);
  return one;
}

std::string list_or_null(const Numbers& numbers) {
  return numbers.empty() ? "null" : fmt::format("[{}]", fmt::join(numbers, ", "));
}

std::string deploy_text(const Variant& one) {
  const Numbers ones(kJoints, 20);
  std::string text = fmt::format(
      "joint_ids_map: [{}]\nstep_dt: 0.02\nstiffness: [{}]\ndamping: [{}]\ndefault_joint_pos: [{}]\nactions:\n"
      "  JointPositionAction: {{ clip: null, scale: {}, offset: {}, joint_ids: {} }}\nobservations:\n",
      fmt::join(one.motors, ", "), fmt::join(ones, ", "), fmt::join(ones, ", "), fmt::join(kDefault, ", "),
      list_or_null(one.action_scale), list_or_null(one.offset),
      one.moved.empty() ? "null" : fmt::format("[{}]", fmt::join(one.moved, ", ")));
  if (one.by_time) text += "  use_gym_history: true\n";
  for (const Term& term : one.terms)
    text += fmt::format(
        "  {}: {{ params: {{{}}}, clip: {}, scale: {}, history_length: {}{} }}\n", term.name,
        term.joints.empty() ? "" : fmt::format(" asset_cfg: {{ joint_ids: [{}] }} ", fmt::join(term.joints, ", ")),
        term.clip == 0 ? "null" : fmt::format("[{}, {}]", -term.clip, term.clip), list_or_null(term.scale),
        term.history, term.scale_first ? ", scale_first: true" : "");
  return text;
}

// What the training's deployment computes. `q`, `dq`: by motor slot, free slots too.
class Reference {
 public:
  explicit Reference(const Variant& one) : one_(one), past_(one.terms.size()) {}

  Numbers observe(const Numbers& q, const Numbers& dq, const Numbers& last) {
    for (std::size_t t = 0; t < one_.terms.size(); ++t) {
      const Numbers now = values_of(one_.terms[t], q, dq, last);
      auto& past = past_[t];
      while (past.size() < one_.terms[t].history) past.push_back(now);
      past.push_back(now);
      past.pop_front();
    }
    Numbers all;
    const auto add = [&](const Numbers& values) { all.insert(all.end(), values.begin(), values.end()); };
    if (one_.by_time)
      for (std::size_t then = 0; then < one_.terms[0].history; ++then)
        for (const auto& past : past_) add(past[then]);
    else
      for (const auto& past : past_)
        for (const Numbers& values : past) add(values);
    return all;
  }

  // Each motor slot's target; a joint that no output moves is not there.
  std::vector<std::pair<std::size_t, double>> act(const Numbers& outputs) const {
    std::vector<std::pair<std::size_t, double>> targets;
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      const std::size_t joint = one_.moved.empty() ? i : one_.moved[i];
      const double scale = one_.action_scale.empty() ? 1 : one_.action_scale[i];
      targets.emplace_back(one_.motors[joint], (one_.offset.empty() ? 0 : one_.offset[i]) + scale * outputs[i]);
    }
    return targets;
  }

 private:
  Numbers values_of(const Term& term, const Numbers& q, const Numbers& dq, const Numbers& last) const {
    const std::string name = term.name;
    Numbers raw = last;
    if (name != "last_action") {
      raw.clear();
      const Indices all{0, 1, 2, 3};
      for (const std::size_t joint : term.joints.empty() ? all : term.joints)
        raw.push_back(name == "joint_pos_rel" ? q[one_.motors[joint]] - kDefault[joint] : dq[one_.motors[joint]]);
    }
    for (std::size_t i = 0; i < raw.size(); ++i) {
      const double scale = term.scale.empty() ? 1 : term.scale[i];
      if (term.scale_first) raw[i] *= scale;
      if (term.clip > 0) raw[i] = std::clamp(raw[i], -term.clip, term.clip);
      if (!term.scale_first) raw[i] *= scale;
    }
    return raw;
  }

  const Variant& one_;
  std::vector<std::deque<Numbers>> past_;
};

// The largest difference of any value and target over six observations.
double largest_difference(const Variant& one) {
  const config::RobotConfig robot = imported_robot(deploy_text(one), "deploy.yaml", kJoints);
  Indices slots = one.motors;
  std::ranges::sort(slots);
  Reference reference(one);
  ObservationBuilder builder(robot);
  const std::size_t outputs = one.moved.empty() ? kJoints : one.moved.size();
  Numbers last(outputs, 0);
  double largest = 0;
  for (int instant = 1; instant <= 6; ++instant) {
    Numbers q(10), dq(10);
    Observation observation;
    observation.id = static_cast<std::uint64_t>(instant);
    observation.published_at = MonoTime{} + milliseconds(20) * instant;
    observation.joint_count = kJoints;
    for (std::size_t j = 0; j < kJoints; ++j) {
      observation.q[j] = static_cast<float>(std::sin(1.3 * instant + static_cast<double>(j)));
      observation.dq[j] = static_cast<float>(9 * std::cos(0.7 * instant + 2.0 * static_cast<double>(j)));
      q[slots[j]] = static_cast<double>(observation.q[j]);
      dq[slots[j]] = static_cast<double>(observation.dq[j]);
    }
    const std::vector<float> said_last(last.begin(), last.end());
    const auto input = builder.build(observation, {}, said_last);
    const Numbers wanted = reference.observe(q, dq, last);
    if (input.size() != wanted.size()) return std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < wanted.size(); ++i)
      largest = std::max(largest, std::abs(static_cast<double>(input[i]) - wanted[i]));
    for (std::size_t i = 0; i < outputs; ++i)
      last[i] = static_cast<double>(static_cast<float>(std::sin(instant + 0.5 * static_cast<double>(i))));
    CommandChunk chunk;
    ChunkBuilder(robot, 0).fill(chunk, observation, std::vector<float>(last.begin(), last.end()));
    for (const auto& [slot, target] : reference.act(last)) {
      const auto joint = static_cast<std::size_t>(std::ranges::find(slots, slot) - slots.begin());
      const float told = chunk.values[value_index(chunk.header, CommandField::q, 0, joint)];
      largest = std::max(largest, std::abs(static_cast<double>(told) - target));
    }
  }
  return largest;
}

TEST(DeployVariants, TwentySevenFormsShowAndMoveWhatTheirTrainingDid) {
  double worst = 0;
  for (std::size_t i = 0; i < 27; ++i) {
    const Variant one = variant(i % 3, i / 3 % 3, i / 9);
    const double difference = largest_difference(one);
    EXPECT_LE(difference, 1e-6) << "variant " << i << "\n" << deploy_text(one);
    worst = std::max(worst, difference);
  }
  RecordProperty("largest_difference", fmt::format("{:.1e}", worst));
  fmt::print("27 variants, largest difference {:.1e}\n", worst);
}

}  // namespace
}  // namespace takt::policy_host
