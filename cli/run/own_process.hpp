// SPDX-License-Identifier: Apache-2.0
// Work that leaves its process unfit for what comes after it, done in one of its own: loading a policy keeps a process
// off the executive's processor for good, and what it starts (policy_host/fenced_load.hpp), and runs foreign code.
#pragma once

#include <expected>
#include <functional>
#include <string>

#include "cli/command.hpp"
#include "policy_host/boundary.hpp"

namespace takt::cli {

// What `work` answers, from a fork of this process that dies with it, behind a policy's boundary but for `grants`;
// `refused`: exit code of an error it returns. A fork that ends without an answer said why on stderr: its exit code,
// and no sentence; one that was killed: a sentence. Blocks. Thread rule: a process of one thread.
std::expected<std::string, Refusal> in_own_process(const std::function<std::expected<std::string, std::string>()>& work,
                                                   int refused, const policy_host::Grants& grants = {});

}  // namespace takt::cli
