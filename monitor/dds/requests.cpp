// SPDX-License-Identifier: Apache-2.0
#include "monitor/dds/requests.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "config/load.hpp"

namespace takt::monitor::dds {

std::string machine_name() {
  std::string id;
  std::getline(std::ifstream("/etc/machine-id"), id);
  return config::sha256_hex("takt " + id).substr(0, 12);
}

bool is_for(const Request& request, const Address& address) {
  return request.robot == address.robot && (request.machine.empty() || request.machine == address.machine);
}

std::expected<OperatorVerb, std::string> judge(const Request& request, const Address& address,
                                               std::int64_t now_unix_ns) {
  if (request.verb == "stop") return OperatorVerb::stop;
  if (request.verb == "reset")
    return std::unexpected("not by DDS: a stop or fault is cleared on the robot's machine, takt reset");
  if (request.verb != "arm") return std::unexpected(fmt::format("`{}` is no request; write arm or stop", request.verb));
  const Duration late{now_unix_ns - std::max<std::int64_t>(request.sent_unix_ns, 0)};  // nothing was sent before 1970
  if (late > kArmWithin || late < Duration{-kArmWithin.ns})
    return std::unexpected(fmt::format("sent {:.1f} s {} by this machine's clock: send it again, or set the clocks",
                                       std::abs(late.seconds()), late.ns > 0 ? "ago" : "in the future"));
  if (std::ranges::find(address.namesakes, address.machine) != address.namesakes.end())
    return std::unexpected(fmt::format("two robots named {} run on this machine ({}): give each a name of its own",
                                       address.robot, address.machine));
  if (request.machine.empty() && !address.namesakes.empty())
    return std::unexpected(
        fmt::format("more than one robot is named {}: write the machine into the request; this one "
                    "is {}, others are {}",
                    address.robot, address.machine, fmt::join(address.namesakes, ", ")));
  return OperatorVerb::arm;
}

std::string printable(std::string_view word) {
  constexpr std::size_t kMost = 16;
  std::string shown(word.substr(0, kMost));
  for (char& c : shown)
    if (c < ' ' || c > '~') c = '?';
  return shown;
}

}  // namespace takt::monitor::dds
