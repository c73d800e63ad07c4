// SPDX-License-Identifier: Apache-2.0
// A cyclic loop with nothing real around it: virtual time, buses that remember what was sent, drives of one byte. The
// ports are what these tests are about; tests/process runs the whole with real ones.
#pragma once

#include <unistd.h>

#include <deque>
#include <functional>
#include <memory>
#include <vector>

#include "executive/ipc/executive_segments.hpp"
#include "executive/runtime/cyclic_loop.hpp"

namespace takt::runtime::test {

// Time passes when it is waited for, and by one microsecond whenever it is read, so that spinning ends.
class VirtualClock final : public Clock {
 public:
  MonoTime now() noexcept override {
    now_ = now_ + microseconds(1);
    return now_;
  }
  void sleep_until(MonoTime when) noexcept override {
    sleeps_until.push_back(when);
    if (when > now_) now_ = when + wake_delay;
  }
  Duration since_boot() noexcept override { return now_ - MonoTime{} + slept_in_all; }
  void pass(Duration time) noexcept { now_ = now_ + time; }

  Duration wake_delay;
  Duration slept_in_all;  // suspended since boot
  std::vector<MonoTime> sleeps_until;

 private:
  MonoTime now_{1'000'000'000};
};

struct SentFrame {
  std::size_t bus;
  drivers::CanFrame frame;
};

// Remembers what was sent on all buses, in order; hands out what was put into `arriving`.
class FakeBus final : public drivers::CanBus {
 public:
  FakeBus(std::size_t index, std::vector<SentFrame>& sent) : index_(index), sent_(sent) {}
  drivers::SendResult send(const drivers::CanFrame& frame) noexcept override {
    if (on_send) on_send();
    if (refuses) return drivers::SendResult::queue_full;
    sent_.push_back({index_, frame});
    if (on_sent) on_sent(frame);
    return drivers::SendResult::sent;
  }
  std::size_t receive(std::span<drivers::ReceivedFrame> out) noexcept override {
    if (on_receive) on_receive();
    std::size_t count = 0;
    for (; count < out.size() && !arriving.empty(); ++count) {
      out[count] = arriving.front();
      arriving.pop_front();
    }
    return count;
  }
  [[nodiscard]] BusHealth health() const noexcept override { return health_now; }

  std::deque<drivers::ReceivedFrame> arriving;
  BusHealth health_now;
  std::function<void()> on_receive;
  std::function<void()> on_send;
  std::function<void(const drivers::CanFrame&)> on_sent;
  bool refuses = false;

 private:
  std::size_t index_;
  std::vector<SentFrame>& sent_;
};

// Sends one frame: id = joint + 1, byte 0 = enable, byte 1 = it is told to hold (kp), byte 2 = that a command is behind
// it. Listens to id 0x100 + joint, whose byte 0 is its position, byte 1 its state. Reads joint / 8 rad too little.
class OneByteDrive final : public drivers::JointDriver {
 public:
  explicit OneByteDrive(std::uint32_t joint) : joint_(joint) {}
  std::size_t encode(bool enable, const drivers::DriveSetpoint& setpoint, MonoTime, MonoTime valid_until,
                     std::span<drivers::CanFrame> out) noexcept override {
    out[0] = {};
    out[0].id = joint_ + 1;
    out[0].length = 3;
    out[0].data[0] = enable ? 1 : 0;
    out[0].data[1] = setpoint.kp > 0 ? 1 : 0;
    out[0].data[2] = valid_until.is_set() ? 1 : 0;
    return 1;
  }
  [[nodiscard]] bool is_set_up() const noexcept override { return true; }
  bool decode(const drivers::ReceivedFrame& received) noexcept override {
    if (received.frame.id != 0x100 + joint_) return false;
    feedback_.received_at = received.received_at;
    ++feedback_.replies;
    feedback_.q = static_cast<float>(received.frame.data[0]);
    feedback_.drive_state = static_cast<DriveState>(received.frame.data[1]);
    return true;
  }
  [[nodiscard]] const JointFeedback& feedback() const noexcept override { return feedback_; }
  [[nodiscard]] float shift() const noexcept override { return static_cast<float>(joint_) / 8; }

 private:
  std::uint32_t joint_;
  JointFeedback feedback_;
};

// Knows nothing of one-byte drives: refuses what the test says, and replaces it by a frame of two bytes.
class ScriptedGuard final : public drivers::FrameGuard {
 public:
  WireVerdict pass(std::size_t joint, std::size_t bus, const drivers::GuardedMoment& moment, const JointRecord& record,
                   drivers::CanFrame& frame) noexcept override {
    const WireVerdict verdict = judge ? judge(joint, bus, moment, record) : WireVerdict::allowed;
    if (verdict != WireVerdict::allowed) frame.length = 2;
    return verdict;
  }
  std::function<WireVerdict(std::size_t, std::size_t, const drivers::GuardedMoment&, const JointRecord&)> judge;
};

// Works unless the test says otherwise.
class FakeTorqueOutput final : public drivers::TorqueOutput {
 public:
  bool tell(bool permitted) noexcept override {
    if (on_tell) on_tell(permitted);
    return works;
  }
  std::function<void(bool)> on_tell;
  bool works = true;
};

inline pipeline::TickConfig small_tick_config(std::uint32_t joints, std::uint32_t buses) {
  pipeline::TickConfig config;
  config.period = milliseconds(1);
  config.joint_count = joints;
  config.bus_count = buses;
  config.observation_every_ticks = 20;
  config.freshness.max_age = milliseconds(150);
  config.freshness.window_ticks = 1000;
  config.freshness.recover_after = milliseconds(250);
  config.freshness.flap_memory = seconds(10);
  config.freshness.stop_after = milliseconds(600);
  config.freshness.bad_command_limit = 25;
  config.feedback_timeout = milliseconds(20);
  config.enable_timeout = milliseconds(500);
  for (std::uint32_t j = 0; j < joints; ++j) {
    pipeline::JointConfig& joint = config.joints[j];
    joint.limits = {-2, 2, 3, 15, 40, 4000, 300, 5, 0.15F, 8};
    joint.kp = 100;
    joint.kd = joint.damping = 4;
    joint.inertia = 0.1F;
    joint.observer_bandwidth = 200;
    joint.bus = static_cast<std::uint8_t>(j % buses);
  }
  return config;
}

// Joint j sits on bus j % buses. Time is virtual unless `real_time` is given.
class LoopRig {
 public:
  explicit LoopRig(std::size_t joint_count = 3, std::size_t bus_count = 2, const LoopTiming& timing = {{}, {}, 100},
                   Clock* real_time = nullptr, const std::vector<Turns>& turns = {})
      : config(small_tick_config(static_cast<std::uint32_t>(joint_count), static_cast<std::uint32_t>(bus_count))),
        edge(make_edge(joint_count, bus_count, turns)),
        published(PublishedSegments::create(joint_count).value()),
        ticks(published.tick_reader()),
        loop({config, real_time != nullptr ? *real_time : clock, edge, mailboxes, requests, recorded, published, board},
             timing) {
    for (std::size_t j = 0; j < turns.size(); ++j) config.joints[j].turns = turns[j];
  }

  void run(std::uint64_t count) { loop.run(EvidenceSource::open().value(), count); }
  // The newest frames that crossed the edge, or were kept from it.
  std::vector<FrameRecord> frames() {
    auto segment = ipc::Segment::adopt_read_only(dup(published.monitor_descriptors()[ipc::kFrameRingDescriptor]),
                                                 ipc::ring_bytes(ipc::frame_ring()));
    auto reader = ipc::SlotReader::attach(segment.value().readable(), ipc::frame_ring()).value();
    std::vector<FrameRecord> all;
    FrameRecord frame;
    while (reader.read_next(std::as_writable_bytes(std::span(&frame, 1))).status == ipc::ReadStatus::fresh) {
      all.push_back(frame);
    }
    return all;
  }
  // Every tick record published so far and not yet returned.
  std::vector<TickRecord> records() {
    std::vector<TickRecord> all;
    TickRecord record{};
    while (ticks.read_next(std::as_writable_bytes(std::span(&record, 1))).status == ipc::ReadStatus::fresh) {
      all.push_back(record);
    }
    return all;
  }

  pipeline::TickConfig config;
  VirtualClock clock;
  std::vector<SentFrame> sent;
  std::vector<FakeBus*> buses;
  ScriptedGuard* guard = nullptr;
  FakeTorqueOutput* torque = nullptr;
  DriveEdge edge;
  PerSeat<MailboxHandover> mailboxes;
  OperatorInbox requests;
  RecordedThrough recorded;
  PublishedSegments published;
  ipc::SlotReader ticks;
  StatusBoard board;
  CyclicLoop loop;

 private:
  DriveEdge make_edge(std::size_t joint_count, std::size_t bus_count, const std::vector<Turns>& turns) {
    std::vector<std::unique_ptr<drivers::CanBus>> ports;
    for (std::size_t bus = 0; bus < bus_count; ++bus) {
      auto port = std::make_unique<FakeBus>(bus, sent);
      buses.push_back(port.get());
      ports.push_back(std::move(port));
    }
    std::vector<JointOnBus> joints;
    for (std::size_t j = 0; j < joint_count; ++j) {
      joints.push_back({std::make_unique<OneByteDrive>(static_cast<std::uint32_t>(j)), j % bus_count,
                        j < turns.size() ? turns[j] : Turns{}});
    }
    auto made = std::make_unique<ScriptedGuard>();
    guard = made.get();
    auto output = std::make_unique<FakeTorqueOutput>();
    torque = output.get();
    return DriveEdge(std::move(ports), std::move(joints), std::move(made), std::move(output));
  }
};

}  // namespace takt::runtime::test
