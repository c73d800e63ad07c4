// SPDX-License-Identifier: Apache-2.0
// What one tick costs at 1 kHz: wake up, read the command mailbox, decide, push the records. Bus input and output and
// tracing are not in it.
//
// Method: per repetition and size a forked real-time process paces itself with absolute sleeps, pinned, SCHED_FIFO,
// locked memory; another process answers observations at 50 Hz through a real mailbox. The section measured is mailbox
// read, control_tick, and the pushes of tick record, command and observation. Ticks alternate between gravity model off
// and on: the share of the model is on minus off within one run. After each tick the look at whether the robot could be
// stopped (executive/pipeline/brake.hpp) is measured by itself, with torque so scarce and joints so fast that all of
// its rounds are needed; a robot whose torque suffices never takes it. Beside both, the least that a tick must do
// (tick_floor.hpp), in the same process and on the same mailbox: ratios to it hold on any machine. Sizes are
// interleaved over the repetitions; figures are medians over repetitions of each repetition's p50 and p99.
#include <fmt/format.h>
#include <sys/mman.h>

#include <CLI/CLI.hpp>
#include <array>
#include <atomic>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <span>

#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/ipc/slot_ring.hpp"
#include "executive/pipeline/brake.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/pipeline/gravity_model.hpp"
#include "tests/bench/bench.hpp"
#include "tests/bench/tick_floor.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::bench {
namespace {

constexpr std::array<std::uint32_t, 4> kSizes{6, 12, 32, 64};
constexpr int kPriority = 80;
constexpr int kWarmUpTicks = 200;
constexpr std::size_t kMaxSamples = 20'000;

// Zeroed memory that forked children share, as large as a ring needs.
class RingMemory {
 public:
  explicit RingMemory(const ipc::RingShape& shape) : size_(ipc::ring_bytes(shape)) {
    void* const at = mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
    if (at == MAP_FAILED) throw std::bad_alloc();
    data_ = static_cast<std::byte*>(at);
  }
  RingMemory(const RingMemory&) = delete;
  RingMemory& operator=(const RingMemory&) = delete;
  ~RingMemory() { munmap(data_, size_); }
  [[nodiscard]] std::span<std::byte> bytes() const { return {data_, size_}; }
  // By the process that will write to it: what a page's first write costs in a virtual machine (7 us where its page
  // tables are shadowed) is paid in a robot's first seconds alone, and the figures are of the hours after them.
  void touch() const {
    constexpr std::size_t kPage = 4096;
    for (std::size_t at = 0; at < size_; at += kPage) {
      volatile std::byte* const page = data_ + at;
      *page = *page;
    }
  }

 private:
  std::size_t size_;
  std::byte* data_;
};

struct Rings {
  explicit Rings(std::uint32_t joints)
      : observations(ipc::observation_mailbox()),
        commands(ipc::command_mailbox()),
        ticks(ipc::tick_ring(joints)),
        messages(ipc::command_ring()),
        floor(kFloorRing) {}
  void touch() const {
    for (const RingMemory* ring : {&observations, &commands, &ticks, &messages, &floor}) ring->touch();
  }
  RingMemory observations, commands, ticks, messages, floor;
};

struct Samples {
  std::atomic<bool> stop{false};  // the loop is done: the policy may leave
  bool is_realtime = false;
  std::uint32_t tracking = 0;  // measured ticks that were spent tracking
  std::array<std::uint32_t, 2> count{};
  std::array<std::array<std::int64_t, kMaxSamples>, 2> ticks{};  // gravity off, on
  std::uint32_t brake_count = 0;
  std::array<std::int64_t, 2 * kMaxSamples> brakes{}, floors{};
};

template <class Value>
std::span<std::byte> writable_bytes(Value& value) {
  return std::as_writable_bytes(std::span(&value, 1));
}

// The other process: answers each observation with 16 steps of joint targets, as a policy at 50 Hz does.
void answer_observations(const pipeline::TickConfig& config, const Rings& rings, const Samples& samples) {
  const auto observation = std::make_unique<Observation>();
  const auto chunk = std::make_unique<CommandChunk>();
  ipc::SlotWriter commands(rings.commands.bytes(), ipc::command_mailbox());
  std::uint64_t sequence = 0;
  while (!samples.stop.load(std::memory_order_relaxed)) {
    sleep_until(monotonic_now() + milliseconds(2));
    auto reader = ipc::SlotReader::attach(rings.observations.bytes(), ipc::observation_mailbox());
    if (!reader) continue;  // the loop has not formatted it yet
    while (!samples.stop.load(std::memory_order_relaxed)) {
      sleep_until(monotonic_now() + milliseconds(2));
      if (reader->read_latest(writable_bytes(*observation)).status != ipc::ReadStatus::fresh) continue;
      const float target = 0.3F * std::sin(0.05F * static_cast<float>(sequence));
      *chunk = pipeline::testing::chunk_for(config, observation->id, observation->published_at, monotonic_now(),
                                            ++sequence, target);
      commands.publish(writable_bytes(*chunk).first(chunk->used_bytes()));
    }
  }
}

class Loop {
 public:
  Loop(std::uint32_t joints, const Rings& rings)
      : joints_(joints),
        rings_(rings),
        config_{pipeline::testing::robot(joints), pipeline::testing::robot(joints)},
        state_(pipeline::make_tick_state(config_[0])),
        observations_(rings.observations.bytes(), ipc::observation_mailbox()),
        ticks_(rings.ticks.bytes(), ipc::tick_ring(joints)),
        messages_(rings.messages.bytes(), ipc::command_ring()),
        floor_(joints, rings.commands.bytes(), rings.floor.bytes()) {
    config_[1].gravity_compensation = true;
    for (pipeline::TickConfig& config : config_) {
      config.observation_every_ticks = 20;
      config.feedback.contradiction = 0;  // these drives are where they are told to be at once, and tell no velocity
    }
    scarce_ = config_[1];
    gravity_ = pipeline::GravityModel(scarce_);
    for (std::uint32_t j = 0; j < joints; ++j) {
      pipeline::JointConfig& joint = scarce_.joints[j];
      joint.limits.torque = 4.0F * gravity_.most(j) + 0.7F * joint.inertia * joint.limits.acceleration;
    }
  }

  void run(int measured_ticks, Samples& samples) {
    MonoTime due = monotonic_now() + config_[0].period;
    for (int i = 0; i < kWarmUpTicks + measured_ticks; ++i, due = due + config_[0].period) {
      sleep_until(due);
      prepare(monotonic_now());
      const std::size_t gravity = static_cast<std::size_t>(i) % 2;
      const std::int64_t begin = ticks();
      tick(config_[gravity]);
      const std::int64_t spent = ticks() - begin;
      const std::int64_t braked = look_for_a_stop();
      const std::int64_t floor_begin = ticks();
      floor_.tick();
      const std::int64_t floor = ticks() - floor_begin;
      if (i < kWarmUpTicks) continue;
      samples.ticks[gravity][samples.count[gravity]++] = spent;
      samples.floors[samples.brake_count] = floor;
      samples.brakes[samples.brake_count++] = braked;
      samples.tracking += output_->record.header.mode == Mode::tracking ? 1U : 0U;
    }
  }

 private:
  // What the bus edge does: drives that follow their setpoints at once. Not measured.
  void prepare(MonoTime now) {
    ++input_.tick;
    input_.last_sent_at = input_.now;
    input_.now = now;
    input_.operator_request =
        output_->record.header.mode == Mode::standby ? OperatorRequest::arm : OperatorRequest::none;
    for (std::size_t j = 0; j < joints_; ++j) {
      input_.joints[j].received_at = now - microseconds(200);
      ++input_.joints[j].replies;
      input_.joints[j].q = output_->setpoints[j].q;
      input_.joints[j].drive_state = output_->drive_enabled[j] ? DriveState::enabled : DriveState::disabled;
    }
    if (!commands_) {
      auto reader = ipc::SlotReader::attach(rings_.commands.bytes(), ipc::command_mailbox());
      if (reader) commands_ = *reader;
    }
  }

  void tick(const pipeline::TickConfig& config) {
    read_command();
    pipeline::control_tick(*state_, input_, config, *output_);
    if (output_->observation_due) observations_.publish(writable_bytes(output_->observation));
    ticks_.publish(writable_bytes(output_->record).first(output_->record.used_bytes()));
    if (input_.messages[Seat::policy].command != nullptr) {
      CommandTag tag{input_.tick, 0, 0};
      messages_.publish(writable_bytes(tag), writable_bytes(*chunk_).first(input_.messages[Seat::policy].bytes));
    }
  }

  std::int64_t look_for_a_stop() {
    for (std::uint32_t j = 0; j < joints_; ++j) {
      const double speed = 0.3 * static_cast<double>(scarce_.joints[j].limits.velocity);
      stops_[j] = {{0.0, j % 2 == 0 ? speed : -speed}, 0.0, true};
    }
    const std::int64_t begin = ticks();
    stoppable_ = pipeline::can_stop(stops_, output_->record, every_joint(joints_), gravity_, scarce_);
    return ticks() - begin;
  }

  void read_command() {
    input_.messages[Seat::policy].mailbox = Arrival::none;
    input_.messages[Seat::policy].command = nullptr;
    input_.messages[Seat::policy].bytes = 0;
    if (!commands_) return;
    const ipc::ReadResult result = commands_->read_latest(writable_bytes(*chunk_));
    if (result.status != ipc::ReadStatus::fresh) return;
    input_.messages[Seat::policy].mailbox = Arrival::accepted;
    input_.messages[Seat::policy].command = chunk_.get();
    input_.messages[Seat::policy].bytes = result.size;
  }

  std::uint32_t joints_;
  const Rings& rings_;
  std::array<pipeline::TickConfig, 2> config_;
  pipeline::TickConfig scarce_;
  pipeline::GravityModel gravity_;
  std::array<pipeline::Stopping, kMaxJoints> stops_{};
  volatile bool stoppable_ = false;
  pipeline::TickStatePtr state_;
  ipc::SlotWriter observations_, ticks_, messages_;
  TickFloor floor_;
  std::optional<ipc::SlotReader> commands_;
  pipeline::TickInput input_;
  std::unique_ptr<pipeline::TickOutput> output_ = std::make_unique<pipeline::TickOutput>();
  std::unique_ptr<CommandChunk> chunk_ = std::make_unique<CommandChunk>();
};

// p50 and p99 of one repetition, or medians of them, gravity model off and on.
struct Figures {
  std::array<std::vector<double>, 2> p50, p99;
  std::vector<double> brake_p50, brake_p99, floor_p50, floor_p99;
};

// False: the robot was not tracking, so the figures would be of another robot.
bool measure(std::uint32_t joints, int measured_ticks, Figures& figures, bool& is_realtime) {
  const Rings rings(joints);
  const Shared<Samples> samples;
  const std::vector<int> cpus = allowed_cpus();
  ChildProcess policy([&] {
    run_on(std::vector<int>(cpus.begin(), cpus.size() > 1 ? cpus.end() - 1 : cpus.end()));
    answer_observations(pipeline::testing::robot(joints), rings, *samples);
  });
  ChildProcess loop([&] {
    mlockall(MCL_CURRENT | MCL_FUTURE);
    rings.touch();
    Loop body(joints, rings);
    const Pinned pinned(cpus.back(), kPriority);
    samples->is_realtime = pinned.is_realtime();
    body.run(measured_ticks, *samples);
  });
  loop.wait();
  samples->stop = true;
  policy.wait();
  is_realtime &= samples->is_realtime;
  for (std::size_t gravity = 0; gravity < 2; ++gravity) {
    std::vector<double> ns;
    for (std::uint32_t i = 0; i < samples->count[gravity]; ++i)
      ns.push_back(static_cast<double>(samples->ticks[gravity][i]) * ns_per_tick());
    figures.p50[gravity].push_back(percentile(ns, 0.50));
    figures.p99[gravity].push_back(percentile(ns, 0.99));
  }
  const auto add = [&](const auto& measured, std::vector<double>& p50, std::vector<double>& p99) {
    std::vector<double> ns;
    for (std::uint32_t i = 0; i < samples->brake_count; ++i)
      ns.push_back(static_cast<double>(measured[i]) * ns_per_tick());
    p50.push_back(percentile(ns, 0.50));
    p99.push_back(percentile(ns, 0.99));
  };
  add(samples->brakes, figures.brake_p50, figures.brake_p99);
  add(samples->floors, figures.floor_p50, figures.floor_p99);
  return samples->tracking * 10 >= static_cast<std::uint32_t>(measured_ticks) * 9;
}

void print(const Report& report, const char* what, std::uint32_t joints, double p50, double p99) {
  report.figure(fmt::format("{:<14} {:>2} joints   p50 {:>6.0f} ns   p99 {:>6.0f} ns", what, joints, p50, p99),
                {{"what", what}, {"joints", joints}, {"p50_ns", std::round(p50)}, {"p99_ns", std::round(p99)}});
}

int run(bool as_json, int repetitions, int measured_ticks) {
  const Report report(as_json);
  ns_per_tick();
  std::map<std::uint32_t, Figures> figures;
  bool is_realtime = true;
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    for (const std::uint32_t joints : kSizes) {
      if (measure(joints, measured_ticks, figures[joints], is_realtime)) continue;
      report.remark("the robot was not tracking: is another load starving the policy process?");
      return 1;
    }
  }
  if (!is_realtime) report.remark("no real-time rights: figures are of an ordinary process");
  for (const std::uint32_t joints : kSizes)
    print(report, "tick", joints, median(figures[joints].p50[0]), median(figures[joints].p99[0]));
  for (const std::uint32_t joints : kSizes) {
    const Figures& f = figures[joints];
    print(report, "gravity_model", joints, median(f.p50[1]) - median(f.p50[0]), median(f.p99[1]) - median(f.p99[0]));
  }
  for (const std::uint32_t joints : kSizes) {
    const Figures& f = figures[joints];
    const double p50 = median(f.floor_p50), p99 = median(f.floor_p99);
    print(report, "floor", joints, p50, p99);
    report.remark(fmt::format("tick of {} joints: {:.1f} times the floor at p50, {:.1f} at p99", joints,
                              median(f.p50[0]) / p50, median(f.p99[0]) / p99));
  }
  for (const std::uint32_t joints : kSizes) {
    const double p50 = median(figures[joints].brake_p50), p99 = median(figures[joints].brake_p99);
    print(report, "brake", joints, p50, p99);
    report.remark(fmt::format("brake of {} joints: {:.2f} of the tick it belongs to, gravity model on (p50)", joints,
                              p50 / median(figures[joints].p50[1])));
  }
  return 0;
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  CLI::App app{"Cost of one tick at 1 kHz: mailbox read, every stage, record push. Example: takt-bench-tick --json"};
  bool as_json = false;
  int repetitions = 5;
  int measured_ticks = 1200;
  app.add_flag("--json", as_json, "one JSON row per figure: what, joints, p50_ns, p99_ns");
  app.add_option("--repetitions", repetitions, "interleaved repetitions; figures are medians")
      ->check(CLI::Range(1, 99));
  app.add_option("--ticks", measured_ticks, "measured ticks per repetition and size, half with the gravity model")
      ->check(CLI::Range(100, 2 * static_cast<int>(takt::bench::kMaxSamples)));
  CLI11_PARSE(app, argc, argv);
  return takt::bench::run(as_json, repetitions, measured_ticks);
}
