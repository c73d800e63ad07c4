// SPDX-License-Identifier: Apache-2.0
#include "executive/ipc/hello_check.hpp"

#include <algorithm>

#include "executive/contract/contract_layout.hpp"

namespace takt::ipc {

std::string fault_in(const Hello& hello, ssize_t size) {
  constexpr const char* kSameVersion = ": install the same version of Takt on both sides";
  constexpr const char* kOurProtocol = ": this socket speaks Takt's rendezvous protocol only";
  if (size != sizeof(Hello)) {
    return "hello has " + std::to_string(size) + " bytes, expected " + std::to_string(sizeof(Hello)) + kOurProtocol;
  }
  if (hello.magic != kMagic) return std::string("hello has a wrong magic number") + kOurProtocol;
  if (hello.abi_version != kAbiVersion) {
    return "client has ABI version " + std::to_string(hello.abi_version) + ", server has " +
           std::to_string(kAbiVersion) + kSameVersion;
  }
  if (hello.layout != contract_layout()) {
    return std::string("client was built with another layout of the shared structures") + kSameVersion;
  }
  if (static_cast<std::size_t>(hello.role) >= kRoleCount) {
    return "hello asks for role " + std::to_string(static_cast<int>(hello.role)) + ", which does not exist" +
           kSameVersion;
  }
  if (std::ranges::any_of(hello.reserved, [](std::uint8_t byte) { return byte != 0; })) {
    return std::string("hello has reserved bytes set") + kSameVersion;
  }
  return {};
}

std::string fault_in(const PolicyWord& word, ssize_t size) {
  const bool is_one =
      size == sizeof word && word.magic == kMagic && static_cast<std::size_t>(word.kind) < kPolicyWordKindCount;
  return is_one ? std::string() : "expected one byte once, when the mailbox is mapped, and then words of a policy";
}

void make_printable(std::span<char> text) {
  text.back() = '\0';
  const auto end = std::ranges::find(text, '\0');
  std::replace_if(
      text.begin(), end, [](char c) { return c < ' ' || c > '~'; }, '?');
  std::fill(end, text.end(), '\0');
}

}  // namespace takt::ipc
