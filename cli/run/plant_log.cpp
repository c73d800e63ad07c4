// SPDX-License-Identifier: Apache-2.0
#include "cli/run/plant_log.hpp"

#include <time.h>

#include <cstdint>
#include <cstdio>
#include <fstream>
#include <optional>
#include <string_view>

#include "executive/contract/monotonic_clock.hpp"

namespace takt::cli {
namespace {

// "2026-11-21T09:33:00.123Z ..." (executive/log/program_log.cpp).
std::optional<std::int64_t> unix_ns_of(const std::string& line) {
  tm utc{};
  int milliseconds = 0, read = 0;
  // NOLINTNEXTLINE(cert-err34-c): an invalid number ends the reading.
  if (std::sscanf(line.c_str(), "%4d-%2d-%2dT%2d:%2d:%2d.%3dZ%n", &utc.tm_year, &utc.tm_mon, &utc.tm_mday, &utc.tm_hour,
                  &utc.tm_min, &utc.tm_sec, &milliseconds, &read) != 7 ||
      read == 0)
    return std::nullopt;
  utc.tm_year -= 1900;
  utc.tm_mon -= 1;
  return timegm(&utc) * 1'000'000'000LL + milliseconds * 1'000'000LL;
}

MonoTime monotonic_of(std::int64_t unix_ns) {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return monotonic_now() - nanoseconds(std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec - unix_ns);
}

}  // namespace

std::vector<PlantLog::Line> PlantLog::news() {
  constexpr std::string_view kBegins = " scenario: at ", kInstant = " s: ";
  std::vector<Line> lines;
  std::ifstream file(path_, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(read_));
  for (std::string line; std::getline(file, line) && !file.eof();) {
    read_ += line.size() + 1;
    const std::size_t begins = line.find(kBegins);
    if (begins == std::string::npos) continue;
    const std::size_t what = line.find(kInstant, begins + kBegins.size());
    const auto unix_ns = unix_ns_of(line);
    if (what != std::string::npos && unix_ns)
      lines.push_back({monotonic_of(*unix_ns), line.substr(what + kInstant.size())});
  }
  return lines;
}

}  // namespace takt::cli
