// SPDX-License-Identifier: Apache-2.0
// Any text as a robot's model, MJCF or URDF: refused with a sentence, or read, with its lines where they were. What is
// read makes a robot file that is YAML, whatever its joints are called.
//
// MuJoCo's own parser has no coverage here, and a child of ours that costs as much as fifty other inputs: one in 64
// goes through it. Robot files are made of one in 8.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <string>

#include "config/load.hpp"
#include "config/model_import.hpp"
#include "config/model_text.hpp"
#include "simulation/mesh_files.hpp"
#include "simulation/mjcf_file.hpp"
#include "simulation/model_survey.hpp"
#include "simulation/urdf_mimics.hpp"
#include "tests/fuzz/refused_with_a_sentence.hpp"
#include "tests/fuzz/scratch.hpp"

namespace {

using namespace takt;
using fuzz::require;

void read_in_front_of_mujoco(const config::ModelText& model) {
  const auto lines = [](const std::string& text) { return std::ranges::count(text, '\n'); };
  require(static_cast<std::size_t>(lines(model.text)) + 1 == model.lines.size());
  const simulation::MendedMjcf mended = simulation::mend_mjcf(model.text, fuzz::scratch_folder());
  if (lines(mended.text) != lines(model.text)) {
    std::fprintf(stderr, "%s\n", mended.text.c_str());
    std::abort();
  }
  for (const std::string& note : mended.mended) fuzz::require_sentence(config::in_lines_of_files(model, note));
  (void)simulation::find_mesh_files(mended.text, fuzz::scratch_folder(), simulation::stand_in_mesh(0.01));
  (void)simulation::mimics_as_equalities(mended.text);
  (void)config::model_assets(model);
}

void make_robot_of(const config::ModelFacts& facts) {
  for (const bool simulated : {false, true}) {
    const auto robot = config::robot_of_model({.robot = "fuzz",
                                               .policy_file = {},
                                               .joint_names = {},
                                               .source = "model.xml",
                                               .model = facts,
                                               .model_file = "model.xml",
                                               .simulated = simulated});
    fuzz::check_refusal(robot);
    if (!robot) continue;
    const auto read = config::parse(*robot, "config/fuzz.yaml");
    fuzz::judge(read);
    if (read || !read.error().contains("YAML cannot be read")) continue;
    std::fprintf(stderr, "%s\n%s\n", robot->c_str(), read.error().c_str());
    std::abort();
  }
}

// Joints called as the input's words are.
config::ModelFacts facts_named(const std::string& text) {
  config::ModelFacts facts;
  for (std::size_t from = 0; from < text.size() && facts.joints.size() < 4;) {
    const std::size_t end = std::min(text.find('<', from), text.size());
    config::ModelJoint& joint = facts.joints.emplace_back();
    joint.name = text.substr(from, end - from);
    joint.inertia = 1;
    from = end + 1;
  }
  if (!facts.joints.empty()) facts.keyframe = facts.imu_site = facts.joints.back().name;
  return facts;
}

void survey(const std::string& path) {
  const auto facts = simulation::survey_model(path);
  fuzz::check_refusal(facts);
  if (!facts) return;
  for (const std::string& remark : facts->remarks) fuzz::require_sentence(remark);
  for (const config::ModelJoint& joint : facts->joints) {
    require(joint.inertia > 0 && std::isfinite(joint.home));
    require(!joint.position || (joint.home >= joint.position->first && joint.home <= joint.position->second));
  }
  make_robot_of(*facts);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::string path = fuzz::scratch_folder() + "/model.xml";
  fuzz::write_file(path, {data, size});
  const unsigned lot = std::accumulate(data, data + size, 0U);
  if (lot % 8 == 0) make_robot_of(facts_named({data, data + size}));
  const auto model = config::read_model_text(path);
  fuzz::check_refusal(model);
  if (!model) return 0;
  read_in_front_of_mujoco(*model);
  if (lot % 64 == 0) survey(path);
  return 0;
}
