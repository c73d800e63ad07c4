// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/mcap_format.hpp"

#include <zlib.h>

namespace takt::monitor::mcap {
Builder& Builder::text(std::string_view value) {
  put(static_cast<std::uint32_t>(value.size()));
  return raw(value.data(), value.size());
}

Builder& Builder::raw(const void* data, std::size_t size) {
  const std::size_t at = out_.size();
  out_.resize(at + size);
  if (size != 0) std::memcpy(out_.data() + at, data, size);
  return *this;
}

Builder& Builder::map(const std::map<std::string, std::string>& entries) {
  std::size_t size = 0;
  for (const auto& [key, value] : entries) size += 8 + key.size() + value.size();
  put(static_cast<std::uint32_t>(size));
  for (const auto& [key, value] : entries) text(key).text(value);
  return *this;
}

Builder& Builder::begin(Opcode opcode) {
  start_ = out_.size();
  return put(static_cast<std::uint8_t>(opcode)).put(std::uint64_t{0});
}

Builder& Builder::end() {
  const std::uint64_t length = out_.size() - start_ - kRecordHead;
  std::memcpy(out_.data() + start_ + 1, &length, sizeof length);
  return *this;
}

std::span<const std::byte> Parser::take(std::uint64_t size) {
  if (!ok_ || size > in_.size()) {
    ok_ = false;
    return {};
  }
  const auto taken = in_.first(static_cast<std::size_t>(size));
  in_ = in_.subspan(static_cast<std::size_t>(size));
  return taken;
}

std::string Parser::text() {
  const auto taken = take(get<std::uint32_t>());
  std::string value(taken.size(), '\0');
  if (!value.empty()) std::memcpy(value.data(), taken.data(), taken.size());
  return value;
}

std::map<std::string, std::string> Parser::map() {
  Parser inside(take(get<std::uint32_t>()));
  std::map<std::string, std::string> entries;
  while (inside.ok() && !inside.rest().empty()) {
    std::string key = inside.text();
    std::string value = inside.text();
    if (inside.ok()) entries.emplace(std::move(key), std::move(value));
  }
  ok_ = ok_ && inside.ok();
  return entries;
}

std::uint32_t crc32(std::span<const std::byte> data, std::uint32_t seed) {
  return static_cast<std::uint32_t>(::crc32_z(seed, reinterpret_cast<const Bytef*>(data.data()), data.size()));
}

}  // namespace takt::monitor::mcap
