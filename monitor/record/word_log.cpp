// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/word_log.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>

#include "monitor/record/run_events.hpp"

namespace takt::monitor {

void WordLog::note(const PolicyWord& word) {
  const auto role = static_cast<std::size_t>(word.role);
  const auto kind = static_cast<std::size_t>(word.kind);
  if (role >= kRoleCount || kind >= kPolicyWordKindCount) return;
  standing_[role][kind] = word;
  write(word);
}

void WordLog::go_on_in(const RunFolder& next) {
  folder_ = next;
  of_policies_ = of_operators_ = 0;
  for (const auto& of_role : standing_)
    for (const std::optional<PolicyWord>& word : of_role)
      if (word && word->sentence[0] != '\0') write(*word);
}

void WordLog::write(const PolicyWord& word) {
  if (of_policies_ == kMostRunEvents) return;
  ++of_policies_;
  nlohmann::ordered_json more{
      {"role", name(word.role)}, {"kind", name(word.kind)}, {"what", std::string_view(word.sentence)}};
  if (word.kind == PolicyWordKind::source) more["first_sequence"] = word.first_sequence;
  if (word.superseded != 0) more["superseded"] = word.superseded;
  write(event_line(kPolicyEvent, word.heard_at, more));
}

void WordLog::note(const OperatorWord& word) {
  if (of_operators_ == kMostRunEvents) return;
  ++of_operators_;
  write(event_line(kOperatorEvent, word.heard_at,
                   {{"action", name(word.verb)},
                    {"done", word.done != 0},
                    {"pid", word.pid},
                    {"uid", word.uid},
                    {"process", std::string_view(word.program)},
                    {"what", std::string_view(word.answer)}}));
}

void WordLog::write(const std::string& line) {
  const std::string path = folder_.path() + "/" + std::string(kEventsFile);
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0644);
  const bool is_written = file >= 0 && ::write(file, line.data(), line.size()) == static_cast<ssize_t>(line.size());
  failure_ = is_written ? "" : path + ": " + std::system_category().message(errno);
  if (file >= 0) close(file);
}

}  // namespace takt::monitor
