#include "cli/robot/process_check.hpp"

#include "policy_host/engines/load_policy.hpp"
#include "policy_host/policy_fit.hpp"
#include "simulation/robot_plant.hpp"
#include "simulation/world_process.hpp"

namespace takt::cli {

std::string refused_by_policy_host(const config::RobotConfig& robot) {
  if (!robot.policy) return {};
  // What else a policy's file may be is between it and a program in the host's place.
  const std::string& file = robot.policy->file;
  if (!robot.policy->engine && !file.ends_with(".onnx") && !file.ends_with(".pt") && !file.ends_with(".yaml"))
    return {};
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
