// SPDX-License-Identifier: Apache-2.0
// A panel: which tasks, under which perturbations, by which methods, with which seeds. Read from a YAML file as
// strictly as a robot file (config/document.hpp): each problem is one "file:line:column: what; how to correct it". How
// to write one: docs/panels.md.
#pragma once

#include <algorithm>
#include <cstdint>
#include <expected>
#include <optional>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "evidence/rollout/method.hpp"
#include "evidence/rollout/perturbation.hpp"
#include "evidence/rollout/rollout.hpp"
#include "lab/artifact/artifact_manifest.hpp"

namespace takt::lab {

inline constexpr std::string_view kPanelSchema = "takt.panel/1";

struct PanelTask {
  evidence::Task task = evidence::Task::arm_tracking;
  std::string robot;  // path of the robot file, as found from here
  Duration scored;
  double bound_m = 0;
  std::uint32_t modes = 1;  // of its policy, as in PolicyTiming
  double mode_spread = 0;
  std::vector<config::Override> overrides{};   // of the robot file, for every method
  evidence::BaseVelocityTask base_velocity{};  // of that task only
};

struct PanelMethod {
  std::string name, description;
  bool repeat_last = false;
  std::vector<config::Override> overrides;
  evidence::Method method{};  // by its name, where that is a built-in method's
};

struct PanelPerturbation {
  std::string kind{evidence::perturbation_kinds().front().name};
  double dose = 0;
  Duration from, length;
  std::vector<std::size_t> tasks{};       // as Task; empty: every task of the panel
  std::string load{};                     // gpu_contention only
  std::string body{};                     // push and payload only
  std::vector<PanelPerturbation> with{};  // act besides; theirs are empty
  [[nodiscard]] bool troubles(evidence::Task task) const {
    return tasks.empty() || std::ranges::find(tasks, static_cast<std::size_t>(task)) != tasks.end();
  }
  // In rows and tables: `push`, or `push-with-can_loss-0.1`.
  [[nodiscard]] std::string name() const;
  [[nodiscard]] bool has(std::string_view wanted) const {
    return kind == wanted || std::ranges::find(with, wanted, &PanelPerturbation::kind) != with.end();
  }
  [[nodiscard]] evidence::Perturbation resolved() const;
};

struct Panel {
  std::string file;    // as given, for messages
  std::string text;    // its bytes
  std::string sha256;  // of them
  std::string name;
  Duration duration;
  std::uint64_t first_seed = 1, seed_count = 1;
  evidence::PolicyTiming timing;
  Duration window_from, window_length;  // of perturbations that say nothing else
  std::optional<Duration> rearm_after;  // operator: from a stop or fault to the next arming; empty: none
  std::string robot{};                  // instead of every task's own; empty: the file's hold
  std::vector<PanelTask> tasks;         // different ones; a method's overrides go to every task's robot
  std::vector<PanelMethod> methods;
  std::vector<PanelPerturbation> perturbations;
  Claims claims;
};

std::expected<Panel, std::string> load_panel(const std::string& path);
// Of its text: as if it lay at `path`.
std::expected<Panel, std::string> panel_of(const std::string& text, const std::string& path);

}  // namespace takt::lab
