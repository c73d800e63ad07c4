// SPDX-License-Identifier: Apache-2.0
#include "dds/neighbours.hpp"

#include <dds/ddsrt/log.h>
#include <linux/filter.h>
#include <net/if.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <mutex>
#include <string_view>
#include <utility>
#include <vector>

namespace takt::dds {
namespace {

constexpr const char* kLoopback = "lo";
constexpr std::size_t kMostOthers = 1000;  // two instructions each, of at most 4096

std::mutex g_mutex;
LineBudget g_budget;  // guarded

void write_line(void* /*unused*/, const dds_log_data_t* line) {
  const std::scoped_lock lock(g_mutex);
  const auto dropped = g_budget.take(std::chrono::steady_clock::now());
  if (!dropped) return;
  if (*dropped != 0) spdlog::warn("DDS: {} more lines were dropped", *dropped);
  std::string_view text(line->message);
  while (text.ends_with('\n')) text.remove_suffix(1);
  const bool is_error = (line->priority & (DDS_LC_FATAL | DDS_LC_ERROR)) != 0;
  const bool is_warning = (line->priority & DDS_LC_WARNING) != 0;
  spdlog::log(is_error ? spdlog::level::err : is_warning ? spdlog::level::warn : spdlog::level::info, "DDS: {}", text);
}

// Indices of this machine's interfaces but that and the loopback, at most kMostOthers.
std::vector<unsigned> others_than(const std::string& interface) {
  std::vector<unsigned> others;
  struct if_nameindex* const all = if_nameindex();
  for (const struct if_nameindex* one = all; one != nullptr && one->if_index != 0; ++one)
    if (one->if_name != interface && std::string_view(one->if_name) != kLoopback && others.size() < kMostOthers)
      others.push_back(one->if_index);
  if (all != nullptr) if_freenameindex(all);
  return others;
}

int option(int socket, int name) {
  int value = -1;
  socklen_t size = sizeof value;
  return getsockopt(socket, SOL_SOCKET, name, &value, &size) == 0 ? value : -1;
}

}  // namespace

std::optional<std::uint64_t> LineBudget::take(Instant now) {
  if (now - window_begin_ >= kWindow) {
    window_begin_ = now;
    written_ = 0;
  }
  if (written_ == kLines) {
    ++dropped_;
    return std::nullopt;
  }
  ++written_;
  return std::exchange(dropped_, 0);
}

void log_within_budget() {
  dds_set_log_sink(write_line, nullptr);
}

std::uint64_t dropped_lines() {
  const std::scoped_lock lock(g_mutex);
  return g_budget.dropped();
}

std::set<int> datagram_sockets() {
  std::set<int> sockets;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", error)) {
    const std::string name = entry.path().filename();
    int fd = -1;
    std::from_chars(name.data(), name.data() + name.size(), fd);
    const int domain = option(fd, SO_DOMAIN);
    if (option(fd, SO_TYPE) == SOCK_DGRAM && (domain == AF_INET || domain == AF_INET6)) sockets.insert(fd);
  }
  return sockets;
}

bool hear_only(const std::set<int>& sockets, const std::string& interface) {
  if (if_nametoindex(interface.c_str()) == 0) return false;
  const std::vector<unsigned> others = others_than(interface);
  // socket(7), SO_ATTACH_FILTER: by the index of the interface by which a packet came.
  std::vector<sock_filter> program{
      {BPF_LD | BPF_W | BPF_ABS, 0, 0, static_cast<unsigned>(SKF_AD_OFF + SKF_AD_IFINDEX)}};
  if (interface == kLoopback) {
    program.push_back({BPF_JMP | BPF_JEQ | BPF_K, 1, 0, if_nametoindex(kLoopback)});
    program.push_back({BPF_RET | BPF_K, 0, 0, 0});
  }
  // A network card that is plugged in again, or a tunnel that is set up again, is the same name by another index.
  for (const unsigned other : others) {
    program.push_back({BPF_JMP | BPF_JEQ | BPF_K, 0, 1, other});
    program.push_back({BPF_RET | BPF_K, 0, 0, 0});
  }
  program.push_back({BPF_RET | BPF_K, 0, 0, 0xFFFFFFFF});  // all of it
  const sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  return std::ranges::all_of(sockets, [&](int socket) {
    return setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter) == 0;
  });
}

}  // namespace takt::dds
