// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/operator_log.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <fstream>
#include <string>
#include <string_view>

#include "executive/ipc/hello_check.hpp"

namespace takt::runtime {
namespace {

// Empty: the process has ended.
std::string program_of(pid_t pid) {
  std::string program;
  std::getline(std::ifstream("/proc/" + std::to_string(pid) + "/comm"), program);
  return program;
}

}  // namespace

void OperatorLog::note(const ipc::Peer& peer, OperatorVerb verb, const OperatorReply& reply, MonoTime heard_at) {
  if (verb == OperatorVerb::status) return;
  OperatorWord word;
  word.heard_at = heard_at;
  word.pid = peer.pid;
  word.uid = peer.uid;
  word.verb = verb;
  word.done = reply.done;
  program_of(peer.pid).copy(word.program, sizeof word.program - 1);
  ipc::make_printable(word.program);
  const std::string_view said(reply.sentences);  // zero-terminated
  said.substr(0, said.find('\n')).copy(word.answer, sizeof word.answer - 1);
  spdlog::info("{} by pid {} ({}), user {}: {}", name(verb), word.pid, word.program, word.uid,
               word.answer[0] != '\0' ? word.answer
               : word.done != 0       ? "done"
                                      : "refused");
  const bool is_stop =
      verb == OperatorVerb::stop || verb == OperatorVerb::press_stop || verb == OperatorVerb::deenergise;
  const bool is_over = verb == OperatorVerb::reset || verb == OperatorVerb::arm;
  if (is_over && word.done != 0) last_stop_.clear();
  if (is_stop && word.done != 0) last_stop_ = fmt::format("{} (pid {}), user {}", word.program, word.pid, word.uid);
  if (waiting_.size() == kMost) waiting_.pop_front();
  waiting_.push_back(word);
}

void OperatorLog::pass_all(const std::function<bool(const OperatorWord&)>& pass) {
  while (!waiting_.empty() && pass(waiting_.front())) waiting_.pop_front();
}

}  // namespace takt::runtime
