// SPDX-License-Identifier: Apache-2.0
#include "policy_host/leapp/initial_values.hpp"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string_view>

#include "config/read_all.hpp"
#include "config/robot_text.hpp"

namespace takt::policy_host {
namespace {

constexpr std::uintmax_t kMostBytes = 64U << 20U;
constexpr std::uint64_t kMostHeader = 1U << 20U;  // of a file's map: some ten thousand tensors

std::expected<std::string, std::string> bytes_of(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error))
    return std::unexpected(fmt::format("{}: no such file; it stands beside the bundle's YAML", file.string()));
  if (std::filesystem::file_size(file, error) > kMostBytes || error)
    return std::unexpected(fmt::format("{}: larger than {} MiB", file.string(), kMostBytes >> 20U));
  std::ifstream stream(file, std::ios::binary);
  auto bytes = config::read_all(stream);
  if (!bytes) return std::unexpected(fmt::format("{}: reading it failed; check its permissions", file.string()));
  return *std::move(bytes);
}

std::string problem_in(const nlohmann::json& entry, std::size_t bytes, InitialValue& value) {
  if (entry.at("dtype") != "F32") return "is no float32 tensor";
  std::uint64_t count = 1;
  for (const auto& size : entry.at("shape")) {
    value.shape.push_back(size.get<std::int64_t>());
    if (value.shape.back() < 1 || value.shape.back() > 1'000'000) return "has a shape that cannot be";
    count *= static_cast<std::uint64_t>(value.shape.back());
    if (4 * count > kMostBytes) return "has a shape that cannot be";
  }
  const auto begin = entry.at("data_offsets").at(0).get<std::uint64_t>();
  const auto end = entry.at("data_offsets").at(1).get<std::uint64_t>();
  if (begin > end || end > bytes || end - begin != 4 * count) return "points outside the file, or to another size";
  return {};
}

}  // namespace

std::expected<std::map<std::string, InitialValue>, std::string> read_initial_values(const std::filesystem::path& file) {
  static_assert(std::endian::native == std::endian::little);
  const auto bytes = bytes_of(file);
  if (!bytes) return std::unexpected(bytes.error());
  const auto refuse = [&](const std::string& what) {
    return std::unexpected(fmt::format("{}: {}; export the bundle again", file.string(), what));
  };
  std::uint64_t header = 0;
  if (bytes->size() < sizeof(header)) return refuse("no safetensors file");
  std::memcpy(&header, bytes->data(), sizeof(header));
  if (header > bytes->size() - sizeof(header)) return refuse("no safetensors file, or cut short");
  if (header > kMostHeader) return refuse(fmt::format("its map is larger than {} MiB", kMostHeader >> 20U));
  const std::string_view text = std::string_view(*bytes).substr(sizeof(header), header);
  const std::string_view data = std::string_view(*bytes).substr(sizeof(header) + header);
  std::map<std::string, InitialValue> values;
  std::size_t left = data.size();
  try {
    const nlohmann::json map = nlohmann::json::parse(text);
    for (const auto& [key, entry] : map.items()) {
      if (key == "__metadata__") continue;
      InitialValue value;
      if (const std::string problem = problem_in(entry, data.size(), value); !problem.empty())
        return refuse(fmt::format("'{}' {}", config::on_one_line(key), problem));
      const std::size_t size =
          entry["data_offsets"][1].get<std::size_t>() - entry["data_offsets"][0].get<std::size_t>();
      if (size > left)
        return refuse(
            fmt::format("'{}' shares its bytes with others: more values than the file has", config::on_one_line(key)));
      left -= size;
      value.values.resize(size / sizeof(float));
      std::memcpy(value.values.data(), data.data() + entry["data_offsets"][0].get<std::size_t>(), size);
      for (const float each : value.values)
        if (!std::isfinite(each))
          return refuse(fmt::format("'{}' holds a value that is NaN", config::on_one_line(key)));
      values.emplace(key, std::move(value));
    }
  } catch (const nlohmann::json::exception&) {
    return refuse("no safetensors file: its map cannot be read");
  }
  return values;
}

}  // namespace takt::policy_host
