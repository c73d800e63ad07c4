// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/cdr.hpp"

namespace takt::monitor {
namespace {

constexpr std::size_t kEncapsulation = 4;

// `alignment` is a power of two.
std::size_t padding(std::size_t at, std::size_t alignment) {
  return (kEncapsulation - at) & (alignment - 1);
}

// As memcpy; a constant size makes it one instruction.
void copy(std::byte* to, const std::byte* from, std::size_t size) {
  switch (size) {
    case 1:
      std::memcpy(to, from, 1);
      return;
    case 2:
      std::memcpy(to, from, 2);
      return;
    case 4:
      std::memcpy(to, from, 4);
      return;
    default:
      std::memcpy(to, from, 8);
  }
}

}  // namespace

void CdrWriter::clear() {
  bytes_.assign({std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}});
}

void CdrWriter::put_raw(const void* value, std::size_t size) {
  const std::size_t at = bytes_.size() + padding(bytes_.size(), size);
  bytes_.resize(at + size);
  std::memcpy(bytes_.data() + at, value, size);
}

void CdrWriter::put_string(std::string_view text) {
  put_count(text.size() + 1);
  const std::size_t at = bytes_.size();
  bytes_.resize(at + text.size() + 1);
  if (!text.empty()) std::memcpy(bytes_.data() + at, text.data(), text.size());
}

void CdrWriter::put_octets(std::span<const std::byte> octets) {
  put_count(octets.size());
  bytes_.insert(bytes_.end(), octets.begin(), octets.end());
}

CdrReader::CdrReader(std::span<const std::byte> message) : message_(message) {
  ok_ = message.size() >= kEncapsulation && message[0] == std::byte{0} && message[1] == std::byte{1};
}

std::span<const std::byte> CdrReader::take(std::size_t size) {
  if (!ok_ || size > message_.size() - at_) {
    ok_ = false;
    return {};
  }
  const auto taken = message_.subspan(at_, size);
  at_ += size;
  return taken;
}

void CdrReader::get_column(void* first, std::size_t stride, std::size_t size, std::size_t count) {
  if (ok_ && count > 0) (void)take(padding(at_, size));
  const auto taken = take(size * count);
  auto* to = static_cast<std::byte*>(first);
  for (std::size_t at = 0; at < size * count; at += size, to += stride) {
    if (ok_) {
      copy(to, taken.data() + at, size);
    } else {
      std::memset(to, 0, size);
    }
  }
}

std::string CdrReader::get_string() {
  const auto length = get<std::uint32_t>();
  const auto taken = take(length);
  if (!ok_ || length == 0 || taken.back() != std::byte{0}) {
    ok_ = false;
    return {};
  }
  std::string text(length - 1, '\0');
  if (!text.empty()) std::memcpy(text.data(), taken.data(), text.size());
  return text;
}

std::span<const std::byte> CdrReader::get_octets() {
  const auto count = get<std::uint32_t>();
  return take(count);
}

std::size_t CdrReader::get_count(std::size_t most) {
  const auto count = get<std::uint32_t>();
  if (count > most) ok_ = false;
  return ok_ ? count : 0;
}

}  // namespace takt::monitor
