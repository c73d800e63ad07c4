// SPDX-License-Identifier: Apache-2.0
// What the host of a policy says of itself while it holds its lease: why it publishes no command, and which other
// process makes its commands. A claim by an untrusted process: shown and recorded as what it says, never acted on.
//
// The host says it to the executive, which passes it on to the recorder. Thread rule: none of this ever reaches the
// control thread.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "executive/contract/layout.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/session.hpp"

namespace takt {

enum class PolicyWordKind : std::uint8_t { problem, source };
inline constexpr std::size_t kPolicyWordKindCount = 2;

constexpr std::string_view name(PolicyWordKind kind) {
  constexpr std::array<std::string_view, kPolicyWordKindCount> names{"problem", "source"};
  const auto index = static_cast<std::size_t>(kind);
  return index < names.size() ? names[index] : "invalid";
}

struct PolicyWord {
  std::uint64_t magic = kMagic;
  PolicyWordKind kind = PolicyWordKind::problem;
  Role role = Role::policy;  // whose host; the executive's word, as the next two
  std::uint8_t reserved[2] = {};
  std::uint32_t superseded = 0;      // words of this kind that came before it and too fast to be passed on
  MonoTime heard_at;                 // when the executive heard it
  std::uint64_t first_sequence = 0;  // source: of its first command in this session; problem: 0
  char sentence[200] = {};           // zero-terminated, zero-padded; of a problem that is over: empty
};
template <std::same_as<PolicyWord> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(magic),      TAKT_FIELD(kind),     TAKT_FIELD(role),           TAKT_FIELD(reserved),
      TAKT_FIELD(superseded), TAKT_FIELD(heard_at), TAKT_FIELD(first_sequence), TAKT_FIELD(sentence),
  };
}
static_assert(std::is_standard_layout_v<PolicyWord> && sizeof(PolicyWord) == 232);

}  // namespace takt
