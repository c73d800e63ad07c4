// SPDX-License-Identifier: Apache-2.0
// Goal: the floor of what an executive can do on CAN: a loop that wakes up and writes its frames, and does nothing
// else. Method: SCHED_FIFO, memory locked, absolute sleeps; at each wake-up one frame of eight bytes per identifier,
// shared evenly among the interfaces. Prints when it woke up, ns of CLOCK_REALTIME, which a peer's stamps of the same
// frames are compared with. Run by `./dev bench can`, in the emulated robot PC.
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/bench/bench.hpp"

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

std::int64_t now_ns(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return time.tv_sec * kSecond + time.tv_nsec;
}

int open_socket(const std::string& interface) {
  const int socket = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(interface.c_str()));
  if (socket < 0 || setsockopt(socket, SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0) != 0 || address.can_ifindex == 0 ||
      bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    throw std::runtime_error(interface + ": no CAN interface that is up");
  return socket;
}

struct Options {
  std::vector<std::string> interfaces;
  std::uint32_t frames = 6;
  std::size_t periods = 2000;
};

std::vector<std::int64_t> write_each_millisecond(const Options& options) {
  std::vector<int> sockets;
  for (const std::string& interface : options.interfaces) sockets.push_back(open_socket(interface));
  std::vector<std::int64_t> woken;
  woken.reserve(options.periods);
  std::int64_t due = now_ns(CLOCK_MONOTONIC) + kSecond / 10;
  for (std::size_t period = 0; period < options.periods; ++period, due += kSecond / 1000) {
    const timespec until{due / kSecond, due % kSecond};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
    woken.push_back(now_ns(CLOCK_REALTIME));
    for (std::uint32_t number = 0; number < options.frames; ++number) {
      can_frame frame{};
      frame.can_id = number + 1;
      frame.len = 8;
      const int socket = sockets[number * sockets.size() / options.frames];
      if (write(socket, &frame, sizeof frame) != sizeof frame) throw std::runtime_error("a frame was not taken");
    }
  }
  return woken;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Wakes up each millisecond and writes frames; prints when it woke up, ns of CLOCK_REALTIME."};
  Options options;
  app.add_option("interfaces", options.interfaces, "CAN interfaces")->required();
  app.add_option("--frames", options.frames, "per wake-up, with identifiers 1, 2, 3, ...");
  app.add_option("--periods", options.periods, "how many wake-ups");
  CLI11_PARSE(app, argc, argv);
  try {
    if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0 || !takt::bench::set_fifo(80))
      throw std::runtime_error("no real-time rights: run as root");
    for (const std::int64_t woken : write_each_millisecond(options)) std::printf("%ld\n", woken);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "%s\n", problem.what());
    return 1;
  }
  return 0;
}
