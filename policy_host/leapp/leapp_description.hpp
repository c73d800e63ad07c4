// SPDX-License-Identifier: Apache-2.0
// What the YAML of a LEAPP bundle says, in the form common to all exporters. Frames are told from Isaac Lab's names
// (`state:robot:root_ang_vel_b`: the root's, in its own frame); a body quantity without such a name stays unsaid.
#pragma once

#include "policy_host/described_policy.hpp"
#include "policy_host/leapp/leapp_bundle.hpp"

namespace takt::policy_host {

DescribedPolicy describe_leapp(const LeappBundle& bundle);

}  // namespace takt::policy_host
