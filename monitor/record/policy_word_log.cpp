// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/policy_word_log.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>

#include "monitor/record/run_events.hpp"

namespace takt::monitor {

void PolicyWordLog::note(const PolicyWord& word) {
  const auto role = static_cast<std::size_t>(word.role);
  const auto kind = static_cast<std::size_t>(word.kind);
  if (role >= kRoleCount || kind >= kPolicyWordKindCount) return;
  standing_[role][kind] = word;
  write(word);
}

void PolicyWordLog::go_on_in(const RunFolder& next) {
  folder_ = next;
  written_ = 0;
  for (const auto& of_role : standing_)
    for (const std::optional<PolicyWord>& word : of_role)
      if (word && word->sentence[0] != '\0') write(*word);
}

void PolicyWordLog::write(const PolicyWord& word) {
  if (written_ == kMostRunEvents) return;
  ++written_;
  nlohmann::ordered_json more{
      {"role", name(word.role)}, {"kind", name(word.kind)}, {"what", std::string_view(word.sentence)}};
  if (word.kind == PolicyWordKind::source) more["first_sequence"] = word.first_sequence;
  if (word.superseded != 0) more["superseded"] = word.superseded;
  const std::string line = event_line(kPolicyEvent, word.heard_at, more);
  const std::string path = folder_.path() + "/" + std::string(kEventsFile);
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0644);
  const bool is_written = file >= 0 && ::write(file, line.data(), line.size()) == static_cast<ssize_t>(line.size());
  failure_ = is_written ? "" : path + ": " + std::system_category().message(errno);
  if (file >= 0) close(file);
}

}  // namespace takt::monitor
