// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/policy_words.hpp"

#include <algorithm>
#include <cstring>
#include <string_view>
#include <utility>

namespace takt::runtime {
namespace {

bool says_the_same(const PolicyWord& one, const PolicyWord& other) {
  return one.first_sequence == other.first_sequence && std::string_view(one.sentence) == other.sentence;
}

PolicyWord problem_word(Role role, std::string_view sentence) {
  PolicyWord word;
  word.role = role;
  sentence.copy(word.sentence, sizeof word.sentence - 1);
  return word;
}

}  // namespace

PolicyWords::SeatWords& PolicyWords::words_of(Role role) {
  return seats_[seat_of(role).value_or(Seat::policy)];
}

void PolicyWords::put(const PolicyWord& word, MonoTime now) {
  Standing& standing = words_of(word.role).standing[static_cast<std::size_t>(word.kind)];
  if (standing.is_known && says_the_same(standing.word, word)) return;
  if (word.kind == PolicyWordKind::problem && standing.is_known && standing.word.sentence[0] != '\0') {
    words_of(word.role).past_problem = standing.word.sentence;
    words_of(word.role).past_until = now;
  }
  const std::uint32_t superseded = standing.is_due ? standing.word.superseded + 1 : 0;
  standing = {.word = word, .is_known = true, .is_due = true};
  standing.word.superseded = superseded;
  standing.word.heard_at = now;
}

void PolicyWords::take(const PolicyWord& word, MonoTime now) {
  if (word.kind == PolicyWordKind::problem) words_of(word.role).is_presumed = false;
  put(word, now);
}

void PolicyWords::presume(Role role, const std::string& sentence, MonoTime now) {
  if (!problem(role).empty() && !words_of(role).is_presumed) return;
  words_of(role).is_presumed = true;
  put(problem_word(role, sentence), now);
}

void PolicyWords::answers(Role role, MonoTime now) {
  if (std::exchange(words_of(role).is_presumed, false)) put(problem_word(role, ""), now);
}

void PolicyWords::begin(Role role, MonoTime now) {
  SeatWords& seat = words_of(role);
  seat.is_presumed = false;
  seat.standing[static_cast<std::size_t>(PolicyWordKind::source)] = {};
  if (!problem(role).empty()) put(problem_word(role, ""), now);
}

void PolicyWords::end(Role role, const std::string& how, MonoTime now) {
  words_of(role).is_presumed = false;
  words_of(role).standing[static_cast<std::size_t>(PolicyWordKind::source)] = {};
  put(problem_word(role, how), now);
}

std::string PolicyWords::problem(Role role) const {
  return seats_[seat_of(role).value_or(Seat::policy)]
      .standing[static_cast<std::size_t>(PolicyWordKind::problem)]
      .word.sentence;
}

std::string PolicyWords::problem_since(Role role, MonoTime at) const {
  const std::string now = problem(role);
  const SeatWords& seat = seats_[seat_of(role).value_or(Seat::policy)];
  return now.empty() && seat.past_until > at ? seat.past_problem : now;
}

void PolicyWords::tell_all_again() {
  for (SeatWords& seat : seats_.values)
    for (Standing& standing : seat.standing) standing.is_due = standing.is_known && standing.word.sentence[0] != '\0';
}

std::vector<PolicyWord> PolicyWords::take_due(MonoTime now) {
  std::vector<PolicyWord> due;
  for (SeatWords& seat : seats_.values) {
    if (!seat.window_begin.is_set() || now - seat.window_begin >= kWindow) {
      seat.window_begin = now;
      seat.told = 0;
    }
    for (Standing& standing : seat.standing) {
      if (!standing.is_due || seat.told == kBurst) continue;
      ++seat.told;
      due.push_back(standing.word);
      standing.is_due = false;
      standing.word.superseded = 0;
    }
  }
  std::ranges::stable_sort(due, {}, &PolicyWord::heard_at);
  return due;
}

}  // namespace takt::runtime
