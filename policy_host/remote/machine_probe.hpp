// SPDX-License-Identifier: Apache-2.0
// Whether another machine is there though a program on it is not heard: an empty datagram to a UDP port that has no
// listener is refused by the machine itself, which a connected socket is told. Without a refusal nothing is known: a
// firewall may keep it back. So silence counts only of a machine that has refused before.
//
// The address is the other machine's claim; what is sent there is empty, leaves by one interface and is bounded in
// rate. Thread rule: one thread.
#pragma once

#include <netinet/in.h>

#include <optional>
#include <string>

#include "executive/contract/mono_time.hpp"

namespace takt::policy_host::remote {

enum class Machine { unknown, answers, silent };

// IPv4, as numbers; empty: it has none.
std::string address_of(const std::string& interface);

class MachineProbe {
 public:
  static constexpr Duration kPeriod = milliseconds(50);  // between two datagrams in silence
  static constexpr Duration kFarPeriod = seconds(1);     // while nothing is the matter, until it was answered once
  static constexpr int kFirstTries = 10;                 // of those
  explicit MachineProbe(std::string interface) : interface_(std::move(interface)) {}
  MachineProbe(const MachineProbe&) = delete;
  MachineProbe& operator=(const MachineProbe&) = delete;
  ~MachineProbe() { close(); }

  // What is asked from here on. The same again changes nothing; what is no address is not asked.
  void aim(const std::string& address);
  // To be called often. `silent_since`: since when its program is missed; unset: it is heard.
  void ask(MonoTime now, MonoTime silent_since);
  // Since then.
  [[nodiscard]] Machine verdict(MonoTime silent_since) const;

 private:
  void close();
  std::string interface_, address_;
  int socket_ = -1;
  int tries_ = 0;
  MonoTime asked_at_, answered_at_;
};

}  // namespace takt::policy_host::remote
