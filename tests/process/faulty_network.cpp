// SPDX-License-Identifier: Apache-2.0
#include "tests/process/faulty_network.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/if_tun.h>
#include <net/if.h>
#include <poll.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <stdexcept>

#include "executive/contract/monotonic_clock.hpp"

namespace takt::test {
namespace {

constexpr std::size_t kMostFrames = 4096;  // under way; what comes on top is lost, as in a queue that is full
constexpr std::size_t kMtu = 1600;

void must(bool done, const char* what) {
  if (!done) throw std::runtime_error(std::string(what) + ": " + std::strerror(errno));
}

ifreq request(const char* interface) {
  ifreq wanted{};
  std::strncpy(wanted.ifr_name, interface, IFNAMSIZ - 1);
  return wanted;
}

void bring_up(int socket, const char* interface, const char* address) {
  ifreq wanted = request(interface);
  auto* const inet = reinterpret_cast<sockaddr_in*>(&wanted.ifr_addr);
  inet->sin_family = AF_INET;
  if (address != nullptr) {
    inet_pton(AF_INET, address, &inet->sin_addr);
    must(ioctl(socket, SIOCSIFADDR, &wanted) == 0, "address");
    inet_pton(AF_INET, "255.255.255.0", &inet->sin_addr);
    must(ioctl(socket, SIOCSIFNETMASK, &wanted) == 0, "mask");
  }
  wanted = request(interface);
  must(ioctl(socket, SIOCGIFFLAGS, &wanted) == 0, "flags");
  wanted.ifr_flags = static_cast<short>(wanted.ifr_flags | IFF_UP | IFF_RUNNING);
  must(ioctl(socket, SIOCSIFFLAGS, &wanted) == 0, "up");
}

}  // namespace

std::string FaultyNetwork::why_not() {
  if (geteuid() != 0) return "needs root";
  if (access("/dev/net/tun", R_OK | W_OK) != 0) return "needs /dev/net/tun";
  return {};
}

// A thread of its own makes the namespace: the others stay where they are.
FaultyNetwork::End FaultyNetwork::make_end(const char* address) {
  End end;
  std::string failure;
  std::thread([&] {
    try {
      must(unshare(CLONE_NEWNET) == 0, "a network namespace");
      end.name_space = open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC);
      end.tap = open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC);
      ifreq wanted = request("takt0");
      wanted.ifr_flags = IFF_TAP | IFF_NO_PI;
      must(end.tap >= 0 && ioctl(end.tap, TUNSETIFF, &wanted) == 0, "a TAP device");
      const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
      bring_up(socket, "lo", nullptr);
      bring_up(socket, "takt0", address);
      close(socket);
    } catch (const std::exception& error) {
      failure = error.what();
    }
  }).join();
  if (!failure.empty()) throw std::runtime_error(failure);
  return end;
}

FaultyNetwork::FaultyNetwork() : ends_{make_end(kAddresses[0]), make_end(kAddresses[1])} {
  carrier_ = std::thread([this] { carry(); });
}

FaultyNetwork::~FaultyNetwork() {
  stop_ = true;
  carrier_.join();
  for (const End& end : ends_) {
    close(end.tap);
    close(end.name_space);
  }
}

void FaultyNetwork::set(const NetworkFaults& faults) {
  const std::lock_guard lock(mutex_);
  faults_ = faults;
}

Child FaultyNetwork::start(int side, const std::vector<std::string>& arguments, const std::string& log_path) const {
  const int here = open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC);
  must(setns(ends_[side].name_space, CLONE_NEWNET) == 0, "setns");
  Child child(arguments, log_path);
  must(setns(here, CLONE_NEWNET) == 0, "setns back");
  close(here);
  return child;
}

void FaultyNetwork::carry() {
  constexpr int kLongestMs = 5;
  while (!stop_) {
    std::array<pollfd, 2> polled{{{ends_[0].tap, POLLIN, 0}, {ends_[1].tap, POLLIN, 0}}};
    poll(polled.data(), polled.size(), under_way_.empty() ? kLongestMs : 1);
    for (int from = 0; from < 2; ++from) take(from);
    deliver(monotonic_now());
  }
}

void FaultyNetwork::take(int from) {
  NetworkFaults faults;
  {
    const std::lock_guard lock(mutex_);
    faults = faults_;
  }
  std::uniform_real_distribution<double> chance(0, 1);
  std::array<std::uint8_t, kMtu> bytes{};
  for (int frames = 0; frames < 256; ++frames) {
    const ssize_t size = read(ends_[from].tap, bytes.data(), bytes.size());
    if (size <= 0) return;
    const int copies = faults.is_cut || faults.cut_from == from || chance(random_) < faults.loss ? 0
                       : chance(random_) < faults.twice                                          ? 2
                                                                                                 : 1;
    for (int copy = 0; copy < copies && under_way_.size() < kMostFrames; ++copy) {
      const auto jitter = static_cast<std::int64_t>(chance(random_) * static_cast<double>(faults.jitter.ns));
      under_way_.push_back(
          {monotonic_now() + faults.delay + Duration{jitter}, 1 - from, {bytes.begin(), bytes.begin() + size}});
    }
  }
}

void FaultyNetwork::deliver(MonoTime now) {
  const auto due = std::stable_partition(under_way_.begin(), under_way_.end(),
                                         [now](const Frame& frame) { return frame.due > now; });
  std::stable_sort(due, under_way_.end(), [](const Frame& a, const Frame& b) { return a.due < b.due; });
  for (auto frame = due; frame != under_way_.end(); ++frame)
    carried_ += write(ends_[frame->to].tap, frame->bytes.data(), frame->bytes.size()) > 0 ? 1 : 0;
  under_way_.erase(due, under_way_.end());
}

}  // namespace takt::test
