// SPDX-License-Identifier: Apache-2.0
// takt-policy-host: runs the policy of a robot file, by the engine that it names, beside the executive, which does not
// trust it.
#include "policy_host/engines/load_policy.hpp"
#include "policy_host/program.hpp"

int main(int argc, char** argv) {
  return takt::policy_host::run_policy_host(argc, argv, takt::policy_host::load_policy);
}
