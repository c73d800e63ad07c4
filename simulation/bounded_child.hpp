// SPDX-License-Identifier: Apache-2.0
// Work on what a stranger wrote, in a child of ours that ends before it takes too much: a parser's crash, memory and
// time are the child's, and this process goes on.
//
// Thread rule: any; the work runs in a fork, with this thread alone. Blocks until the child has ended.
#pragma once

#include <cstddef>
#include <expected>
#include <functional>
#include <string>

#include "executive/contract/mono_time.hpp"

namespace takt::simulation {

struct ChildBounds {
  std::size_t bytes = std::size_t{1} << 30U;  // beyond what this process holds; not under a sanitizer
  Duration processor_time = seconds(8);       // a whole number of seconds
  Duration longest = seconds(30);             // a file may never come to its end
};

// Error: what `work` returned or threw, or one sentence's end on how the child ended ("took more than 8 s ...").
// What `work` writes elsewhere than into shared memory and files is lost.
std::expected<void, std::string> in_bounded_child(const std::function<std::expected<void, std::string>()>& work,
                                                  const ChildBounds& bounds = {});

}  // namespace takt::simulation
