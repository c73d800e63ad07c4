#include "cli/robot/process_check.hpp"

#include "config/bundle_name.hpp"
#include "policy_host/engines/load_policy.hpp"
#include "policy_host/onnx/model.hpp"
#include "policy_host/policy_fit.hpp"
#include "simulation/robot_plant.hpp"
#include "simulation/world_process.hpp"

namespace takt::cli {
namespace {

// What else a policy's file may be is between it and a program in the host's place.
bool is_the_policy_hosts(const config::Policy& policy) {
  const std::string& file = policy.file;
  if (policy.engine || file.ends_with(".onnx") || file.ends_with(".pt") || config::names_bundle(file)) return true;
  return onnx_engine::read_metadata(file).has_value();  // an ONNX file by another name
}

}  // namespace

std::string refused_by_policy_host(const config::RobotConfig& robot) {
  if (!robot.policy || !is_the_policy_hosts(*robot.policy)) return {};
  if (const auto fine = policy_host::check_policy_section(robot); !fine) return fine.error();
  const auto policy = policy_host::load_policy(robot);
  if (!policy) return policy.error();
  const auto fits = policy_host::check_fit(robot, **policy);
  return fits ? "" : fits.error();
}

std::string refused_by_plant(const config::RobotConfig& robot, const std::string& world) {
  if (!robot.simulation) return {};
  if (!world.empty()) {
    const auto facts = plant::WorldProcess(world).ask(robot);
    return facts ? "" : facts.error().sentence;
  }
  const auto plant = plant::RobotPlant::make(robot);
  return plant ? "" : plant.error();
}

}  // namespace takt::cli
