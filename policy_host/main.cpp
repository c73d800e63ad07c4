// takt-policy-host: runs the ONNX policy of a robot file beside the executive, which does not trust it.
#include "policy_host/onnx_policy.hpp"
#include "policy_host/program.hpp"

int main(int argc, char** argv) {
  return takt::policy_host::run_policy_host(argc, argv, takt::policy_host::load_robot_policy);
}
