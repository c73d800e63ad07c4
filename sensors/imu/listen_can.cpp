// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <poll.h>

#include <array>

#include "drivers/bus/open_bus.hpp"
#include "sensors/imu/listen.hpp"

namespace takt::sensors {
namespace {

// Frames have the kernel's stamps, so that this makes no sample younger or older, only later to be had.
constexpr timespec kPause{.tv_sec = 0, .tv_nsec = 500'000};

}  // namespace

std::string listen_can(const config::Bus& bus, const std::string& runtime_directory, const MtCanIds& ids, ImuSeat& seat,
                       const Signals& signals) {
  auto opened = drivers::open_bus(bus, runtime_directory, std::vector(ids.begin(), ids.end()));
  if (!opened) return opened.error();
  ImuFeed feed(seat);
  MtCanGroups groups(ids);
  GravityCheck gravity;
  std::array<drivers::ReceivedFrame, 32> frames;
  while (!signals.stop) {
    const std::size_t count = opened->bus->receive(frames);
    for (const drivers::ReceivedFrame& frame : std::span(frames).first(count)) {
      const auto whole = groups.take(frame);
      if (!whole) continue;
      if (gravity.take(whole->sample))
        feed.publish(whole->sample, whole->first_frame_at);
      else if (!gravity.doubt().empty())
        feed.refuse(gravity.doubt());
    }
    feed.report(groups.incomplete());
    if (opened->bus->health().state == BusState::down) return bus.interface + " is down or gone";
    if (feed.is_silent()) return fmt::format("{}: {}", bus.interface, groups.why_none());
    if (count < frames.size()) ::ppoll(nullptr, 0, &kPause, &signals.while_waiting);
  }
  return {};
}

}  // namespace takt::sensors
