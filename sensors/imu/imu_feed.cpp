// SPDX-License-Identifier: Apache-2.0
#include "sensors/imu/imu_feed.hpp"

#include <spdlog/spdlog.h>

#include "executive/contract/monotonic_clock.hpp"

namespace takt::sensors {
namespace {

constexpr Duration kSilence = seconds(1);
constexpr Duration kReportPeriod = seconds(1);

}  // namespace

ImuFeed::ImuFeed(ImuSeat& seat)
    : seat_(seat), reading_(seat.mounting), heard_at_(monotonic_now()), reported_at_(heard_at_) {}

void ImuFeed::publish(const MtSample& sample, Heard heard) {
  heard_at_ = monotonic_now();
  seat_.complaint.forget();
  if (reading_.counts().samples == 0) spdlog::info("an MTi is heard at {}", seat_.place);
  auto made = reading_.take(sample, heard);
  if (!made) return;
  made->sequence = ++seat_.sequence;
  made->published_at = monotonic_now();
  seat_.server.publish(*made);
}

void ImuFeed::refuse(const std::string& why) {
  heard_at_ = monotonic_now();
  seat_.complaint.say(heard_at_, why);
}

void ImuFeed::report(std::uint64_t damaged) {
  const MonoTime now = monotonic_now();
  if (now - reported_at_ <= kReportPeriod) return;
  reported_at_ = now;
  const ImuCounts& counts = reading_.counts();
  if (counts.lost == reported_.lost && counts.repeated == reported_.repeated && damaged == reported_damaged_) return;
  spdlog::warn("of {} samples so far: {} lost, {} repeated; {} came damaged", counts.samples, counts.lost,
               counts.repeated, damaged);
  reported_ = counts;
  reported_damaged_ = damaged;
}

bool ImuFeed::is_silent() const {
  return monotonic_now() - heard_at_ > kSilence;
}

}  // namespace takt::sensors
