// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/round_trip.hpp"

#include <array>
#include <thread>
#include <utility>

#include "executive/ipc/slot_ring.hpp"

namespace takt::bench {
namespace {

constexpr std::chrono::milliseconds kPatience{15'000};
constexpr std::chrono::microseconds kPause{500};
constexpr int kWarmUpTrips = 200;

template <class Condition>
bool wait_for(Condition condition) {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(kPause);
  }
  return true;
}

}  // namespace

RoundTrip::RoundTrip(std::string name, const int (&cpus)[2], int trips, Connect connect)
    : name_(std::move(name)), trips_(trips), connect_(std::move(connect)) {
  for (const int side : {1, 0}) {
    sides_[side] = std::make_unique<ChildProcess>([this, side, cpu = cpus[side]] { run_side(side, cpu); });
  }
}

RoundTrip::~RoundTrip() {
  control_->ended.store(true);
  for (auto& side : sides_) side->kill_now();
}

std::optional<double> RoundTrip::measure() {
  if (!wait_for([this] { return control_->ready.load() == 2; })) return {};
  const int repetition = control_->asked.fetch_add(1) + 1;
  if (!wait_for([this, repetition] { return control_->done.load() == repetition; })) return {};
  return control_->half_p50_ns;
}

void RoundTrip::run_side(int side, int cpu) {
  const Pinned pinned(cpu);
  const std::unique_ptr<Transport> transport = connect_(side);
  control_->ready.fetch_add(1);
  side == 0 ? measure_repetitions(*transport) : echo(*transport);
}

// Both sides sleep between repetitions, so that they disturb nothing else that is measured.
void RoundTrip::echo(Transport& transport) {
  while (!control_->ended.load()) {
    Message message;
    while (control_->asked.load() > control_->done.load()) {
      if (transport.receive(message)) transport.send(message);
    }
    std::this_thread::sleep_for(kPause);
  }
}

void RoundTrip::measure_repetitions(Transport& transport) {
  std::uint64_t number = 0;
  while (!control_->ended.load()) {
    if (control_->asked.load() == control_->done.load()) {
      std::this_thread::sleep_for(kPause);
      continue;
    }
    std::vector<double> halves;
    for (int trip = 0; trip < trips_ + kWarmUpTrips; ++trip) {
      Message message;
      message.words[0] = ++number;
      const std::int64_t begin = ticks();
      transport.send(message);
      while (transport.receive(message) && message.words[0] != number) {
      }
      const double half = 0.5 * static_cast<double>(ticks() - begin) * ns_per_tick();
      if (trip >= kWarmUpTrips) halves.push_back(half);
    }
    control_->half_p50_ns = median(std::move(halves));
    control_->done.fetch_add(1);
  }
}

namespace {

constexpr ipc::RingShape kShape{ipc::kMailboxSlots, sizeof(Message), 1};

struct Mailboxes {
  alignas(64) std::array<std::byte, 8192> memory[2];
};

class MailboxTransport final : public Transport {
 public:
  MailboxTransport(Mailboxes& mailboxes, int side)
      : writer_(mailboxes.memory[side], kShape), reader_(attach(mailboxes.memory[1 - side])) {}
  void send(const Message& message) override { writer_.publish(std::as_bytes(std::span(&message, 1))); }
  bool receive(Message& message) override {
    const std::int64_t deadline = ticks() + static_cast<std::int64_t>(1e8 / ns_per_tick());
    while (reader_.read_latest(std::as_writable_bytes(std::span(&message, 1))).status != ipc::ReadStatus::fresh) {
      if (ticks() > deadline) return false;
    }
    return true;
  }

 private:
  static ipc::SlotReader attach(std::span<const std::byte> memory) {
    for (;;) {
      if (auto reader = ipc::SlotReader::attach(memory, kShape)) return *reader;
      std::this_thread::sleep_for(kPause);  // the other side has not formatted it yet
    }
  }
  ipc::SlotWriter writer_;
  ipc::SlotReader reader_;
};

}  // namespace

std::unique_ptr<RoundTrip> mailbox_round_trip(const int (&cpus)[2]) {
  const auto mailboxes = std::make_shared<Shared<Mailboxes>>();
  return std::make_unique<RoundTrip>("takt mailbox, polled", cpus, 20'000, [mailboxes](int side) {
    return std::make_unique<MailboxTransport>(**mailboxes, side);
  });
}

}  // namespace takt::bench
