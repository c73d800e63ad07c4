// SPDX-License-Identifier: Apache-2.0
// The policy host around any engine: everything that takt-policy-host does, behind one function.
//
// It reads the robot file, builds observations, paces itself by them, takes samples of outside sensors, stamps every
// stage, publishes action chunks and attaches again whenever the executive restarts. The engine sees numbers only
// (policy.hpp); shapes come from the robot file's `policy` section and are checked before anything is attached:
//
//   input:  config::observation_width(robot) values, the observation terms one after the other, each times its scale:
//           angles in rad, velocities in rad/s, sensors in SI units (docs/policies.md)
//   output: robot.policy->steps * config::outputs_per_step(robot) values, step after step; a joint's target in rad is
//           offset + scale * value
//
// `policy.file` must exist: its SHA-256 tells the executive which policy this is. What is in it is the engine's affair.
#pragma once

#include "config/observation_shape.hpp"
#include "config/robot_config.hpp"
#include "policy_host/fenced_load.hpp"
#include "policy_host/policy.hpp"

namespace takt::policy_host {

// The whole program: command line, refusals on stderr, signals; see its --help. Returns the exit code: 0 ended by
// SIGINT, SIGTERM or SIGHUP (or --help), 64 usage, 65 configuration or policy refused.
// Errors: an exception that leaves the engine ends the process with one line and 70; the executive then degrades and
// stops the robot.
// Thread rule: once per process, on the main thread, which is also the one that loads, infers and destroys the engine;
// with policy.requests_in_flight above 1 each engine infers in a thread of its own.
// Threads that the engine starts are kept off the executive's processor (processor_fence.hpp).
int run_policy_host(int argc, char** argv, const LoadPolicy& load);

}  // namespace takt::policy_host
