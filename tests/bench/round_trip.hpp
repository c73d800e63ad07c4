// SPDX-License-Identifier: Apache-2.0
// A 512-byte round trip between two processes over any transport: one child echoes, one measures, and the parent, which
// runs neither, asks for one repetition at a time so that transports can be interleaved.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "tests/bench/bench.hpp"

namespace takt::bench {

struct Message {
  std::uint64_t words[64] = {};
};

// One end. Side 0 measures, side 1 echoes. The constructor returns once the other side is reachable.
class Transport {
 public:
  Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;
  virtual ~Transport() = default;
  virtual void send(const Message& message) = 0;
  // Waits for the next message as this transport does best. False after about 100 ms without one.
  virtual bool receive(Message& message) = 0;
};

class RoundTrip {
 public:
  using Connect = std::function<std::unique_ptr<Transport>(int side)>;
  // `cpus`: where side 0 and side 1 run. `connect` is called in each child.
  RoundTrip(std::string name, const int (&cpus)[2], int trips, Connect connect);
  RoundTrip(const RoundTrip&) = delete;
  RoundTrip& operator=(const RoundTrip&) = delete;
  ~RoundTrip();
  // Half a round trip in ns, p50 of one repetition. Nothing when a side died or never became ready.
  std::optional<double> measure();
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  struct Control {
    std::atomic<int> ready;   // sides that are connected
    std::atomic<int> asked;   // repetitions asked for
    std::atomic<int> done;    // repetitions measured
    std::atomic<bool> ended;  // both sides exit
    double half_p50_ns;
  };
  void run_side(int side, int cpu);
  void measure_repetitions(Transport& transport);
  void echo(Transport& transport);

  std::string name_;
  int trips_;
  Connect connect_;  // also keeps alive what it holds, such as a daemon
  Shared<Control> control_;
  std::unique_ptr<ChildProcess> sides_[2];
};

// The transports compared. The peers exist where their library was installed when this was built.
std::unique_ptr<RoundTrip> mailbox_round_trip(const int (&cpus)[2]);
std::unique_ptr<RoundTrip> iceoryx_round_trip(const int (&cpus)[2]);
std::unique_ptr<RoundTrip> cyclone_round_trip(const int (&cpus)[2]);

}  // namespace takt::bench
