// takt-policy-host: runs the ONNX policy of a robot file beside the executive, which does not trust it.
#include "policy_host/onnx_policy.hpp"
#include "policy_host/program.hpp"

int main(int argc, char** argv) {
  return takt::policy_host::run_policy_host(argc, argv, [](const takt::config::RobotConfig& robot) {
    return takt::policy_host::load_onnx_policy(robot.policy->file, robot.policy->input, robot.policy->output);
  });
}
