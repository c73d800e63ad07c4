// SPDX-License-Identifier: Apache-2.0
// iceoryx, polled with take(), queue of one: its fastest way to the latest value. The daemon that iceoryx needs
// runs in a child of ours, with one small memory pool.
#include <fcntl.h>

#include <cstring>
#include <iceoryx_hoofs/posix_wrapper/signal_watcher.hpp>
#include <iceoryx_posh/internal/roudi/roudi.hpp>
#include <iceoryx_posh/popo/publisher.hpp>
#include <iceoryx_posh/popo/subscriber.hpp>
#include <iceoryx_posh/roudi/iceoryx_roudi_components.hpp>
#include <iceoryx_posh/runtime/posh_runtime.hpp>
#include <thread>

#include "tests/bench/round_trip.hpp"

namespace takt::bench {
namespace {

class IceoryxTransport final : public Transport {
 public:
  explicit IceoryxTransport(int side)
      : publisher_(description(side), {}), subscriber_(description(1 - side), latest_only()) {
    while (!publisher_.hasSubscribers() || subscriber_.getSubscriptionState() != iox::SubscribeState::SUBSCRIBED) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  void send(const Message& message) override {
    publisher_.loan()
        .and_then([&](auto& sample) {
          std::memcpy(sample.get(), &message, sizeof message);
          sample.publish();
        })
        .or_else([](auto&) {});
  }
  bool receive(Message& message) override {
    const std::int64_t deadline = ticks() + static_cast<std::int64_t>(1e8 / ns_per_tick());
    for (bool has_come = false; !has_come;) {
      subscriber_.take().and_then([&](const auto& sample) {
        std::memcpy(&message, sample.get(), sizeof message);
        has_come = true;
      });
      if (!has_come && ticks() > deadline) return false;
    }
    return true;
  }

 private:
  static iox::capro::ServiceDescription description(int side) {
    if (side == 0) return {"takt-bench", "round-trip", "measuring"};
    return {"takt-bench", "round-trip", "echoing"};
  }
  static iox::popo::SubscriberOptions latest_only() {
    iox::popo::SubscriberOptions options;
    options.queueCapacity = 1;
    options.queueFullPolicy = iox::popo::QueueFullPolicy::DISCARD_OLDEST_DATA;
    return options;
  }
  iox::popo::Publisher<Message> publisher_;
  iox::popo::Subscriber<Message> subscriber_;
};

void be_quiet() {
  const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  dup2(nowhere, STDOUT_FILENO);
  dup2(nowhere, STDERR_FILENO);
  iox::log::LogManager::GetLogManager().SetDefaultLogLevel(iox::log::LogLevel::kOff);
}

void run_daemon(std::atomic<bool>& ready) {
  be_quiet();
  iox::mepoo::MePooConfig pool;
  pool.addMemPool({1024, 256});
  iox::RouDiConfig_t config;
  const auto group = iox::posix::PosixGroup::getGroupOfCurrentProcess().getName();
  config.m_sharedMemorySegments.push_back({group, group, pool});
  iox::roudi::IceOryxRouDiComponents components(config);
  // `false`: the sides are killed before the daemon ends, it need not wait for them.
  const iox::roudi::RouDi daemon(components.rouDiMemoryManager, components.portManager,
                                 iox::roudi::RouDi::RoudiStartupParameters{iox::roudi::MonitoringMode::OFF, false});
  ready.store(true);
  iox::posix::waitForTerminationRequest();
}

// Lives for as long as the sides that use it. They wait for it by spinning, in real time, and would starve it: it must
// be ready before they start.
class Daemon {
 public:
  Daemon() {
    for (int i = 0; i < 5'000 && !ready_->load(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;
  ~Daemon() { process_.terminate(); }

 private:
  Shared<std::atomic<bool>> ready_;
  ChildProcess process_{[this] { run_daemon(*ready_); }};
};

}  // namespace

std::unique_ptr<RoundTrip> iceoryx_round_trip(const int (&cpus)[2]) {
  const auto daemon = std::make_shared<Daemon>();
  return std::make_unique<RoundTrip>("iceoryx " TAKT_BENCH_ICEORYX ", polled", cpus, 5'000, [daemon](int side) {
    be_quiet();
    const iox::RuntimeName_t names[2] = {"takt-bench-measuring", "takt-bench-echoing"};
    iox::runtime::PoshRuntime::initRuntime(names[side]);
    return std::make_unique<IceoryxTransport>(side);
  });
}

}  // namespace takt::bench
