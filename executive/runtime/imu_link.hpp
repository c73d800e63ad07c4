// SPDX-License-Identifier: Apache-2.0
// The base's IMU, which another process publishes as a sensor (ipc/sensor_server.hpp): attached to as often as needed
// by the service thread, read once per tick by the control thread. The process is as little trusted as a policy is: its
// samples are copied once, and the tick judges them.
//
// Thread rules: ImuMailbox::read() control thread, no allocation or system call; everything else service thread.
// serve() waits at most kImuAttachTimeout for a process that listens and does not answer, twice a second.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "executive/contract/imu.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"
#include "executive/runtime/mailbox_handover.hpp"

namespace takt::runtime {

inline constexpr std::chrono::milliseconds kImuAttachTimeout{20};

struct ImuMailbox {
  ipc::Segment segment;
  ipc::SlotReader reader;  // control thread

  // Newest sample, if there is one that was not read before and has as many values as an IMU; else `sample` stays.
  void read(ImuSample& sample) noexcept;
};

class ImuLink {
 public:
  ImuLink(std::string socket, std::string sensor) : socket_(std::move(socket)), sensor_(std::move(sensor)) {}

  // Attaches where it is time to, lets go of a process that went away, and logs either once.
  void serve(MonoTime now);
  [[nodiscard]] Handover<ImuMailbox>& mailboxes() { return mailboxes_; }

 private:
  std::string attach();  // empty: attached

  std::string socket_, sensor_;
  Handover<ImuMailbox> mailboxes_;
  std::unique_ptr<ipc::Lease> lease_;  // null: not attached
  MonoTime next_attempt_;
  std::string said_;
};

}  // namespace takt::runtime
