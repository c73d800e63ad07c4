#include "monitor/dds/requests.hpp"

#include <fmt/format.h>

#include <cmath>

namespace takt::monitor::dds {

std::expected<OperatorVerb, std::string> judge(const Request& request, std::int64_t now_unix_ns) {
  if (request.verb == "stop") return OperatorVerb::stop;
  if (request.verb == "reset")
    return std::unexpected("not by DDS: a stop or fault is cleared on the robot's machine, takt reset");
  if (request.verb != "arm") return std::unexpected(fmt::format("`{}` is no request; write arm or stop", request.verb));
  const Duration late{now_unix_ns - request.sent_unix_ns};
  if (late > kArmWithin || late < Duration{-kArmWithin.ns})
    return std::unexpected(fmt::format("sent {:.1f} s {} by this machine's clock: send it again, or set the clocks",
                                       std::abs(late.seconds()), late.ns > 0 ? "ago" : "in the future"));
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
