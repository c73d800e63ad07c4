// SPDX-License-Identifier: Apache-2.0
// Writes what the hosts of policies say of themselves into events.jsonl of a run folder (run_events.hpp), and what
// stands into each further part of the run: so each part says by itself whose commands it has. And who asked for what
// of the robot. Never more than kMostRunEvents of each a part. Thread rule: one thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "executive/contract/operator_word.hpp"
#include "executive/contract/policy_word.hpp"
#include "monitor/record/run_folder.hpp"

namespace takt::monitor {

// RunEvent::event of such lines.
inline constexpr std::string_view kPolicyEvent = "policy";
inline constexpr std::string_view kOperatorEvent = "operator";

class WordLog {
 public:
  explicit WordLog(RunFolder folder) : folder_(std::move(folder)) {}
  void note(const PolicyWord& word);
  void note(const OperatorWord& word);
  // The next part of the run begins.
  void go_on_in(const RunFolder& next);
  // Why the newest line was not written; empty: it was.
  [[nodiscard]] const std::string& failure() const { return failure_; }

 private:
  void write(const PolicyWord& word);
  void write(const std::string& line);
  RunFolder folder_;
  std::array<std::array<std::optional<PolicyWord>, kPolicyWordKindCount>, kRoleCount> standing_;
  std::size_t of_policies_ = 0, of_operators_ = 0;  // lines in this part
  std::string failure_;
};

}  // namespace takt::monitor
