// What a request from DDS comes to, before the executive is asked.
#pragma once

#include <expected>
#include <string>
#include <string_view>

#include "executive/contract/mono_time.hpp"
#include "monitor/dds/messages.hpp"

namespace takt::monitor::dds {

// A request to arm that was under way for longer, or claims to come from the future by more, is refused: the person who
// sent it looks elsewhere by now. A stop is never too late. Needs clocks that agree this well.
inline constexpr Duration kArmWithin = seconds(2);

// The verb to hand to the executive, or the sentence to answer with.
std::expected<OperatorVerb, std::string> judge(const Request& request, std::int64_t now_unix_ns);

// A stranger's word, fit for a log: at most 16 printable ASCII characters, others shown as `?`.
std::string printable(std::string_view word);

}  // namespace takt::monitor::dds
