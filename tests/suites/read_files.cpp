// SPDX-License-Identifier: Apache-2.0
// takt-suite-files json|mcap FOLDER: what Takt's readers say of each file there, as one JSON object on stdout, by the
// file's name: of JSON whether it is read; of MCAP whether it is whole, and its messages.
#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "monitor/record/bounded_file.hpp"
#include "monitor/record/mcap_reader.hpp"
#include "monitor/record/strict_json.hpp"

namespace {

using Json = nlohmann::ordered_json;

std::string hex(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte byte : bytes) text += fmt::format("{:02x}", static_cast<unsigned>(byte));
  return text;
}

Json told_of_json(const std::string& path) {
  const auto text = takt::monitor::read_file(path);
  return text && takt::monitor::parse_strict(*text).has_value();
}

Json told_of_mcap(const std::string& path) {
  const auto reader = takt::monitor::McapReader::open(path);
  if (!reader) return reader.error();
  Json messages = Json::array();
  const takt::monitor::McapReport report = reader->scan([&](const takt::monitor::McapMessage& message) {
    messages.push_back({message.topic, message.log_time, message.schema_name, hex(message.data)});
    return true;
  });
  return {{"whole", report.finished && report.unread_bytes == 0 && report.damaged_chunks == 0},
          {"metadata", report.metadata},
          {"messages", messages}};
}

}  // namespace

int main(int count, char** words) {
  const std::string_view kind = count == 3 ? words[1] : "";
  if (kind != "json" && kind != "mcap") return 64;
  Json told;
  for (const auto& entry : std::filesystem::directory_iterator(words[2])) {
    if (entry.path().extension() != fmt::format(".{}", kind)) continue;
    const std::string path = entry.path().string();
    told[entry.path().filename().string()] = kind == "json" ? told_of_json(path) : told_of_mcap(path);
  }
  fmt::print("{}\n", told.dump());
  return 0;
}
