// SPDX-License-Identifier: Apache-2.0
// Who asked for what of the robot, on its way to the log and the recorder. While there is no recorder, or it is behind,
// the newest kMost wait. Thread rule: service thread.
#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <string>

#include "executive/contract/operator_word.hpp"
#include "executive/ipc/rendezvous.hpp"

namespace takt::runtime {

class OperatorLog {
 public:
  static constexpr std::size_t kMost = 64;

  // Writes a line into the log, too. Questions for the status are not noted.
  void note(const ipc::Peer& peer, OperatorVerb verb, const OperatorReply& reply, MonoTime heard_at);
  // Oldest first, for as long as `pass` says that it could.
  void pass_all(const std::function<bool(const OperatorWord&)>& pass);
  // Who asked last for a stop since the robot was reset or armed: "takt (pid 4711), user 1000". Empty: no operator did.
  [[nodiscard]] const std::string& last_stop() const { return last_stop_; }

 private:
  std::deque<OperatorWord> waiting_;
  std::string last_stop_;
};

}  // namespace takt::runtime
