// SPDX-License-Identifier: Apache-2.0
// Which mutant is on: what the rewritten sources of build/mutants ask, and nothing else. The environment says it when
// the program starts:
//
// TAKT_MUTANT=1a2b3c4d       this one is on; unset or unknown: none, the program is the original
// TAKT_MUTANTS_REACHED=FILE  every place that is passed is appended to FILE when the program ends, one number a line
//
// Any thread; never blocks, never allocates after the start. In constant evaluation everything is the original.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

// What was an operator is a call now, and a literal is no constant any more.
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wfloat-conversion"
#pragma GCC diagnostic ignored "-Wsign-compare"
#pragma GCC diagnostic ignored "-Wnarrowing"
#pragma GCC diagnostic ignored "-Wtype-limits"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wunused-but-set-variable"
#pragma GCC diagnostic ignored "-Wunused-variable"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wreturn-type"
#pragma GCC diagnostic ignored "-Warray-bounds"
#pragma GCC diagnostic ignored "-Wstringop-overflow"
#pragma GCC diagnostic ignored "-Wstringop-overread"
#pragma GCC diagnostic ignored "-Wshift-count-overflow"
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wfloat-equal"

namespace takt_mutant {

using Id = std::uint32_t;

inline constexpr std::size_t kSlots = std::size_t{1} << 15U;  // several times as many as there are mutants
inline constinit Id chosen = 0;
inline constinit bool is_recording = false;
inline constinit std::atomic<Id> reached[kSlots] = {};

// An open hash table: the thread that finds an empty slot takes it.
inline void note(Id id) noexcept {
  for (std::size_t i = id % kSlots, tries = 0; tries < kSlots; i = (i + 1) % kSlots, ++tries) {
    Id there = reached[i].load(std::memory_order_relaxed);
    if (there == 0 && reached[i].compare_exchange_strong(there, id)) return;
    if (there == id) return;
  }
}

class Chooser {
 public:
  Chooser() {
    if (const char* const id = std::getenv("TAKT_MUTANT")) chosen = static_cast<Id>(std::strtoul(id, nullptr, 16));
    is_recording = std::getenv("TAKT_MUTANTS_REACHED") != nullptr;
  }
  ~Chooser() {
    if (!is_recording) return;
    std::FILE* const file = std::fopen(std::getenv("TAKT_MUTANTS_REACHED"), "a");
    if (file == nullptr) return;
    for (const std::atomic<Id>& slot : reached)
      if (slot.load() != 0) std::fprintf(file, "%08x\n", slot.load());
    std::fclose(file);
  }
  Chooser(const Chooser&) = delete;
  Chooser& operator=(const Chooser&) = delete;
};
inline const Chooser chooser;

constexpr bool on(Id id) noexcept {
  if
    consteval {
      return false;
    }
  else {
    if (is_recording) note(id);
    return chosen == id;
  }
}

constexpr bool negated(Id id, bool condition) noexcept {
  return on(id) != condition;
}

// a < b, mutated: a <= b. The others likewise.
constexpr bool less(Id id, const auto& a, const auto& b) noexcept {
  return on(id) ? a <= b : a < b;
}
constexpr bool less_equal(Id id, const auto& a, const auto& b) noexcept {
  return on(id) ? a < b : a <= b;
}
constexpr bool greater(Id id, const auto& a, const auto& b) noexcept {
  return on(id) ? a >= b : a > b;
}
constexpr bool greater_equal(Id id, const auto& a, const auto& b) noexcept {
  return on(id) ? a > b : a >= b;
}
constexpr bool equal(Id id, const auto& a, const auto& b) noexcept {
  return on(id) ? a != b : a == b;
}
constexpr bool not_equal(Id id, const auto& a, const auto& b) noexcept {
  return on(id) ? a == b : a != b;
}
// In the head of a counting loop: the last round is left out.
constexpr bool all_but_last(Id id, const auto& a, const auto& b) noexcept {
  return on(id) ? a + 1 < b : a < b;
}

template <typename Number>
constexpr Number shifted(Id plus, Id minus, Number value) noexcept {
  return on(plus) ? static_cast<Number>(value + 1) : on(minus) ? static_cast<Number>(value - 1) : value;
}
constexpr bool flipped(Id id, bool value) noexcept {
  return on(id) != value;
}

}  // namespace takt_mutant
