// SPDX-License-Identifier: Apache-2.0
// What a request from DDS comes to, before the executive is asked.
#pragma once

#include <expected>
#include <string>
#include <string_view>
#include <vector>

#include "executive/contract/mono_time.hpp"
#include "monitor/dds/messages.hpp"

namespace takt::monitor::dds {

// A request to arm that was under way for longer, or claims to come from the future by more, is refused: the person who
// sent it looks elsewhere by now. A stop is never too late. Needs clocks that agree this well.
inline constexpr Duration kArmWithin = seconds(2);

// Who is meant by a request: robots of one robot file have one name on every computer.
struct Address {
  std::string robot, machine;
  std::vector<std::string> namesakes{};  // machines of other robots in the domain with this name
};

// Which computer this is, 12 hex digits: a hash of /etc/machine-id, which itself is not to leave the machine.
std::string machine_name();

// Whether the request counts for the robot at this address.
bool is_for(const Request& request, const Address& address);
// The verb to hand to the executive, or the sentence to answer with. Precondition: is_for().
std::expected<OperatorVerb, std::string> judge(const Request& request, const Address& address,
                                               std::int64_t now_unix_ns);

// A stranger's word, fit for a log: at most 16 printable ASCII characters, others shown as `?`.
std::string printable(std::string_view word);

}  // namespace takt::monitor::dds
