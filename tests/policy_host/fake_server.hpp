// SPDX-License-Identifier: Apache-2.0
// The other ends of the policy host's links, over real sockets and mailboxes: a sensor, and an executive that publishes
// observations when told and reads commands.
#pragma once

#include <unistd.h>

#include <array>
#include <atomic>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "executive/contract/contract_layout.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::policy_host {

template <class Value>
Value must(std::expected<Value, std::string> result) {
  if (!result) throw std::runtime_error(result.error());
  return std::move(*result);
}

// Serves one socket from a thread of its own until destroyed.
class Serving {
 public:
  Serving(const std::string& socket, ipc::RendezvousServer::Handlers handlers)
      : server_(must(ipc::RendezvousServer::listen(socket, getuid(), std::move(handlers)))), thread_([this] {
          while (!stop_) server_.serve(std::chrono::milliseconds(5));
        }) {}
  ~Serving() {
    stop_ = true;
    thread_.join();
  }
  Serving(const Serving&) = delete;
  Serving& operator=(const Serving&) = delete;

 private:
  std::atomic<bool> stop_ = false;
  ipc::RendezvousServer server_;
  std::thread thread_;
};

class FakeSensor {
 public:
  explicit FakeSensor(const std::string& socket, const ipc::RingShape& shape = ipc::sensor_mailbox())
      : segment_(must(ipc::Segment::create("sensor", ipc::ring_bytes(shape), true))),
        writer_(segment_.writable(), shape),
        serving_(socket, {.admit =
                              [this](const ipc::Peer&) {
                                return ipc::Admission{{}, {segment_.fd()}};
                              },
                          .acknowledged = [](const ipc::Peer&) {},
                          .recorded = {},
                          .left = [](const ipc::Peer&) {},
                          .request = {}}) {}
  void publish(const SensorSample& sample) { writer_.publish(std::as_bytes(std::span(&sample, 1))); }
  void publish(std::span<const std::byte> payload) { writer_.publish(payload); }

 private:
  ipc::Segment segment_;
  ipc::SlotWriter writer_;
  Serving serving_;
};

class FakeExecutive {
 public:
  // `largest_input`: bytes; not 0: it hands out a ring for the policy's inputs too.
  explicit FakeExecutive(const std::string& socket, std::size_t largest_input = 0)
      : observations_(must(ipc::Segment::create("observations", ipc::ring_bytes(ipc::observation_mailbox()), true))),
        commands_(must(ipc::Segment::create("commands", ipc::ring_bytes(ipc::command_mailbox()), false))),
        inputs_(largest_input == 0 ? std::nullopt
                                   : std::optional(must(ipc::Segment::create(
                                         "inputs", ipc::ring_bytes(ipc::policy_input_ring(largest_input)), false)))),
        writer_(observations_.writable(), ipc::observation_mailbox()),
        serving_(socket, {.admit = [this](const ipc::Peer& peer) { return admit(peer); },
                          .acknowledged = [this](const ipc::Peer&) { acknowledged_ = true; },
                          .recorded = {},
                          .said = [this](const ipc::Peer&, const PolicyWord& word) { hear(word); },
                          .left = [](const ipc::Peer&) {},
                          .request = {}}) {}

  // The newest of this kind that the policy's host said.
  [[nodiscard]] PolicyWord said(PolicyWordKind kind) const {
    const std::lock_guard lock(said_mutex_);
    return said_.at(static_cast<std::size_t>(kind));
  }

  // The policy mapped its mailbox: from now on commands can be read. Called by the test's thread only.
  bool acknowledged() {
    if (!acknowledged_) return false;
    if (!reader_) {
      if (!commands_.seal_against_new_writers() || !commands_.map_read_only()) return false;
      reader_.emplace(must(ipc::SlotReader::attach(commands_.readable(), ipc::command_mailbox())));
    }
    return true;
  }
  void publish(const Observation& observation) { writer_.publish(std::as_bytes(std::span(&observation, 1))); }
  ipc::ReadResult look(CommandChunk& chunk) {
    return reader_->read_latest(std::as_writable_bytes(std::span(&chunk, 1)));
  }
  // Once it is acknowledged: the ring of the policy's inputs, for a reader.
  [[nodiscard]] ipc::Segment inputs(std::size_t largest_input) const {
    return must(
        ipc::Segment::adopt_read_only(dup(inputs_->fd()), ipc::ring_bytes(ipc::policy_input_ring(largest_input))));
  }
  bool read(CommandChunk& chunk) { return look(chunk).status == ipc::ReadStatus::fresh; }
  [[nodiscard]] Hello hello() const { return hello_; }  // meaningful once acknowledged

 private:
  ipc::Admission admit(const ipc::Peer& peer) {
    hello_ = peer.hello;
    ipc::Admission admission{{}, {observations_.fd(), commands_.fd()}};
    if (inputs_) admission.descriptors.push_back(inputs_->fd());
    return admission;
  }

  void hear(const PolicyWord& word) {
    const std::lock_guard lock(said_mutex_);
    said_.at(static_cast<std::size_t>(word.kind)) = word;
  }

  mutable std::mutex said_mutex_;
  std::array<PolicyWord, kPolicyWordKindCount> said_;  // guarded
  ipc::Segment observations_;
  ipc::Segment commands_;
  std::optional<ipc::Segment> inputs_;
  ipc::SlotWriter writer_;
  std::optional<ipc::SlotReader> reader_;
  Hello hello_;
  std::atomic<bool> acknowledged_ = false;
  Serving serving_;
};

}  // namespace takt::policy_host
