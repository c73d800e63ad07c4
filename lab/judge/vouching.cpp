// SPDX-License-Identifier: Apache-2.0
#include "lab/judge/vouching.hpp"

#include <fmt/format.h>

#include "monitor/record/run_manifest.hpp"

namespace takt::lab {
namespace {

constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;

std::string utc_of(const TimeStamp& stamp) {
  return monitor::utc_text(stamp.unix_s * kNanosecondsPerSecond);
}

}  // namespace

bool Vouching::holds() const {
  return (!signed_by || signed_by->has_value()) && (!stamped || stamped->has_value());
}

std::string vouching_lines(const Vouching& vouching) {
  std::string text;
  if (vouching.signed_by && !*vouching.signed_by)
    text += fmt::format("{:<20}differs: {}\n", "signature", vouching.signed_by->error());
  if (vouching.stamped && !*vouching.stamped)
    text += fmt::format("{:<20}differs: {}\n", "time stamp", vouching.stamped->error());
  return text;
}

std::string vouching_rests(const Vouching& vouching) {
  std::string rests;
  if (vouching.signed_by) rests = vouching.is_signed() ? "signed by " + **vouching.signed_by : "not signed by that key";
  if (vouching.stamped && *vouching.stamped)
    rests += fmt::format(", stamped {} by {}", utc_of(**vouching.stamped), (*vouching.stamped)->by);
  if (vouching.stamped && !*vouching.stamped) rests += ", not stamped by that authority";
  return rests;
}

void add_vouching(const Vouching& vouching, nlohmann::ordered_json& json) {
  using Json = nlohmann::ordered_json;
  const auto refusal = [](const std::string& why) { return Json{{"refusal", why}}; };
  json["signed_by"] = nullptr;
  if (vouching.signed_by)
    json["signed_by"] =
        *vouching.signed_by ? Json{{"key", **vouching.signed_by}} : refusal(vouching.signed_by->error());
  json["stamped"] = nullptr;
  if (vouching.stamped)
    json["stamped"] = *vouching.stamped ? Json{{"utc", utc_of(**vouching.stamped)}, {"by", (*vouching.stamped)->by}}
                                        : refusal(vouching.stamped->error());
}

}  // namespace takt::lab
