// SPDX-License-Identifier: Apache-2.0
#include "simulation/truth_log.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <iterator>
#include <span>

namespace takt::simulation {
namespace {

void append_list(std::string& line, std::string_view key, std::span<const double> values) {
  fmt::format_to(std::back_inserter(line), ",\"{}\":[{:.6g}]", key, fmt::join(values, ","));
}

std::span<const double> entries(const Eigen::VectorXd& vector) {
  return {vector.data(), static_cast<std::size_t>(vector.size())};
}

}  // namespace

double tool_error(const Truth& truth) {
  return std::hypot(truth.tool[0] - truth.target[0], truth.tool[1] - truth.target[1], truth.tool[2] - truth.target[2]);
}

std::expected<TruthLog, std::string> TruthLog::create(const std::string& path) {
  std::FILE* file = std::fopen(path.c_str(), "we");
  if (file == nullptr) return std::unexpected(path + ": cannot be written (" + std::strerror(errno) + ")");
  return TruthLog(file);
}

void TruthLog::write(const Truth& truth) {
  line_.clear();
  fmt::format_to(std::back_inserter(line_), "{{\"monotonic_ns\":{}", truth.at.ns);
  append_list(line_, "q", entries(truth.arm.q));
  append_list(line_, "dq", entries(truth.arm.dq));
  append_list(line_, "tool", truth.tool);
  append_list(line_, "target", truth.target);
  fmt::format_to(std::back_inserter(line_), ",\"error_m\":{:.6g}}}\n", tool_error(truth));
  std::fwrite(line_.data(), 1, line_.size(), file_.get());
}

void TruthLog::flush() {
  std::fflush(file_.get());
}

}  // namespace takt::simulation
