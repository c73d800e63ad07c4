// SPDX-License-Identifier: Apache-2.0
// What the policies' hosts say of themselves (contract/policy_word.hpp), on its way to the log and the recorder: of
// each seat and kind the newest stands until another comes. A host that says more than kBurst words in kWindow has the
// newest of them passed on when there is room again, and the others are counted. Pure. Thread rule: service thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "executive/contract/mono_time.hpp"
#include "executive/contract/policy_word.hpp"

namespace takt::runtime {

class PolicyWords {
 public:
  static constexpr std::uint32_t kBurst = 10;
  static constexpr Duration kWindow = seconds(10);

  // What the host of word.role said.
  void take(const PolicyWord& word, MonoTime now);
  // Its lease began: nothing of before stands.
  void begin(Role role, MonoTime now);
  // Its lease is over: `how` stands as the reason why no command comes.
  void end(Role role, const std::string& how, MonoTime now);
  // It has given no usable command for long and says nothing: `sentence` stands for its word until it says one, another
  // one is presumed, or it `answers` again.
  void presume(Role role, const std::string& sentence, MonoTime now);
  void answers(Role role, MonoTime now);
  // Why this policy publishes no command, as it says; empty: it did not say.
  [[nodiscard]] std::string problem(Role role) const;
  // The same as of `at` or later: what is over since is still why commands stayed away then.
  [[nodiscard]] std::string problem_since(Role role, MonoTime at) const;
  // A recorder came, who knows nothing yet: all that stands is told again.
  void tell_all_again();
  // What is to be told now, oldest first.
  std::vector<PolicyWord> take_due(MonoTime now);

 private:
  struct Standing {
    PolicyWord word;
    bool is_known = false, is_due = false;
  };
  struct SeatWords {
    std::array<Standing, kPolicyWordKindCount> standing;
    MonoTime window_begin;
    std::uint32_t told = 0;  // in this window
    bool is_presumed = false;
    std::string past_problem;  // the newest that is over
    MonoTime past_until;
  };
  SeatWords& words_of(Role role);
  void put(const PolicyWord& word, MonoTime now);
  PerSeat<SeatWords> seats_;
};

}  // namespace takt::runtime
