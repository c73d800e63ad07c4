// SPDX-License-Identifier: Apache-2.0
// Whether another machine is there though a program on it is not heard: a TCP connection to a port that has no listener
// is refused by the machine itself. (An ICMP error for a datagram would say the same, but kernels bound their rate, and
// DDS discovery spends it.) Without an answer nothing is known: a firewall may keep it back. So silence counts only of
// a machine that has answered before.
//
// The address is the other machine's claim: nothing is sent to it but the beginning of a connection, by one interface,
// at a bounded rate.
// Thread rule: one thread.
#pragma once

#include <netinet/in.h>

#include <array>
#include <cstddef>
#include <string>
#include <utility>

#include "executive/contract/mono_time.hpp"

namespace takt::policy_host::remote {

enum class Machine { unknown, answers, silent };

// IPv4, as numbers; empty: it has none.
std::string address_of(const std::string& interface);

class MachineProbe {
 public:
  static constexpr Duration kPeriod = milliseconds(50);  // between two tries in silence
  static constexpr Duration kFarPeriod = seconds(1);     // while nothing is the matter, until it was answered once
  static constexpr int kFirstTries = 10;                 // of those
  explicit MachineProbe(std::string interface) : interface_(std::move(interface)) {}
  MachineProbe(const MachineProbe&) = delete;
  MachineProbe& operator=(const MachineProbe&) = delete;
  ~MachineProbe() { give_up(); }

  // What is asked from here on. The same again changes nothing; what is no address is not asked.
  void aim(const std::string& address);
  // To be called often. `silent_since`: since when its program is missed; unset: it is heard.
  void ask(MonoTime now, MonoTime silent_since);
  // Since then.
  [[nodiscard]] Machine verdict(MonoTime silent_since) const;

 private:
  void give_up();
  void begin_try(int& socket) const;
  std::string interface_, address_;
  sockaddr_in to_{};                                    // sin_family 0: nothing is asked
  std::array<int, 6> sockets_{-1, -1, -1, -1, -1, -1};  // tries under way
  std::size_t next_ = 0;
  int tries_ = 0;
  MonoTime asked_at_, answered_at_;
};

}  // namespace takt::policy_host::remote
