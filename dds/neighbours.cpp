// SPDX-License-Identifier: Apache-2.0
#include "dds/neighbours.hpp"

#include <dds/ddsrt/log.h>
#include <linux/filter.h>
#include <net/if.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <mutex>
#include <string_view>
#include <utility>

namespace takt::dds {
namespace {

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
  const unsigned index = if_nametoindex(interface.c_str()), loopback = if_nametoindex("lo");
  if (index == 0) return false;
  // socket(7), SO_ATTACH_FILTER: the index of the interface by which a packet came, against the two.
  constexpr auto kInterface = static_cast<unsigned>(SKF_AD_OFF + SKF_AD_IFINDEX);
  std::array<sock_filter, 5> program{sock_filter{BPF_LD | BPF_W | BPF_ABS, 0, 0, kInterface},
                                     sock_filter{BPF_JMP | BPF_JEQ | BPF_K, 1, 0, index},
                                     sock_filter{BPF_JMP | BPF_JEQ | BPF_K, 0, 1, loopback},
                                     sock_filter{BPF_RET | BPF_K, 0, 0, 0xFFFFFFFF},  // all of it
                                     sock_filter{BPF_RET | BPF_K, 0, 0, 0}};
  const sock_fprog filter{program.size(), program.data()};
  return std::ranges::all_of(sockets, [&](int socket) {
    return setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter) == 0;
  });
}

}  // namespace takt::dds
