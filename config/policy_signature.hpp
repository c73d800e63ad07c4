// SPDX-License-Identifier: Apache-2.0
// Whether a policy may move a robot whose file names a key (policy.signed_by): its file, with all that policy_files()
// names, is the one that the key's owner signed.
//
// The signature is FILE.sig: the 64 bytes of Ed25519 over the 32 bytes of policy_sha256(). What is signed is what is
// hashed: no other file comes between the two. docs/policies.md has the commands that make one.
#pragma once

#include <expected>
#include <string>

#include "config/robot_config.hpp"

namespace takt::config {

std::string signature_of_policy(const std::string& file);

// policy_sha256() of the policy's file. The error: one sentence, why it cannot be read, or why the key's owner did not
// sign it, and how to correct that.
std::expected<std::string, std::string> accepted_policy_sha256(const Policy& policy);

}  // namespace takt::config
