// SPDX-License-Identifier: Apache-2.0
// What one joint's frames cost per tick, protocol by protocol: encode the command and decode the reply, host side.
//
// Method: the driver and the simulated drive of the first joint of each protocol in a robot file work together in
// virtual time until the drive is enabled; then one more exchange is kept, and its encode and its decode are timed in
// batches on one pinned thread, the protocols taking turns. The last guard is timed in the same batches, on the frames
// that were just encoded, with a record that says they are what was decided. Figures are per joint and tick, the
// guard's per frame: medians over the batches' means. Targets: encode + decode <= 100 ns, guard <= 60 ns.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <memory>
#include <vector>

#include "config/load.hpp"
#include "drivers/guard/wire_guard.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "simulation/device_table.hpp"
#include "tests/bench/bench.hpp"

namespace takt::bench {
namespace {

constexpr int kBatches = 2001, kPerBatch = 500;
constexpr int kPatience = 5000;                           // ticks until enabled
constexpr double kTarget_ns = 100, kGuardTarget_ns = 60;  // guard: per frame

// A driver and its drive, enabled, with the frames of one exchange.
class Exchange {
 public:
  Exchange(const config::RobotConfig& robot, std::size_t joint)
      : protocol_(robot.joints[joint].drive.protocol), guard_(robot), joint_(joint), bus_(robot.joints[joint].bus) {
    driver_ = drivers::make_lone_driver(robot, joint).value();
    auto device = simulation::make_device(robot.joints[joint].drive, milliseconds(100));
    MonoTime now = MonoTime{} + seconds(1);
    for (int tick = 0; tick < kPatience; ++tick, now = now + milliseconds(1)) {
      const bool was_enabled = enabled();
      const std::size_t sent = driver_->encode(tick > kPatience / 2, setpoint_, now, now + milliseconds(50), out_);
      simulation::Frames answers;
      for (std::size_t i = 0; i < sent; ++i) device->receive(out_[i], now, answers);
      device->update({0.1, 0.2}, now, milliseconds(1), answers);
      replies_.clear();
      for (const drivers::CanFrame& answer : answers) {
        driver_->decode({answer, now});
        replies_.push_back({answer, now});
      }
      if (!was_enabled || replies_.empty()) continue;
      decide(now);
      return;
    }
    throw std::runtime_error("the drive was never enabled");
  }

  double encode_ns() {
    constexpr MonoTime kNow{1};
    const std::int64_t begin = ticks();
    for (int i = 0; i < kPerBatch; ++i) {
      setpoint_.q += 1e-5F;
      driver_->encode(true, setpoint_, kNow, kNow + milliseconds(50), out_);
      keep(out_[0].data[0]);
    }
    return since(begin);
  }
  double decode_ns() {
    const std::int64_t begin = ticks();
    for (int i = 0; i < kPerBatch; ++i) {
      for (const drivers::ReceivedFrame& reply : replies_) driver_->decode(reply);
      keep(driver_->feedback().replies);
    }
    return since(begin);
  }
  double guard_ns() {
    setpoint_.q = record_.q_command;  // the batches before have moved it
    const std::size_t sent = driver_->encode(true, setpoint_, moment_.now, moment_.valid_until, out_);
    const std::int64_t begin = ticks();
    for (int i = 0; i < kPerBatch; ++i) {
      for (std::size_t f = 0; f < sent; ++f) {
        const WireVerdict verdict = guard_.pass(joint_, bus_, moment_, record_, out_[f]);
        if (verdict != WireVerdict::allowed)
          throw std::runtime_error(fmt::format("the guard refused {}'s frame: {}", name(),
                                               kWireVerdictNames.at(static_cast<std::size_t>(verdict))));
      }
      keep(out_[0].data[0]);
    }
    return since(begin) / static_cast<double>(sent);
  }
  [[nodiscard]] std::string_view name() const { return config::name(protocol_); }
  std::vector<double> encode, decode, both, guard;

 private:
  // What the guard compares with: the setpoint as the tick would have recorded it, at the newest feedback.
  void decide(MonoTime now) {
    moment_ = {now, now, now + milliseconds(50), true};
    const JointFeedback& feedback = driver_->feedback();
    record_.feedback = feedback;
    record_.q_estimate = feedback.q;
    record_.dq_estimate = feedback.dq;
    setpoint_.q = feedback.q + 0.02F;
    record_.q_command = setpoint_.q;
    record_.dq_command = setpoint_.dq;
    record_.kp_command = setpoint_.kp;
    record_.kd_command = setpoint_.kd;
    record_.tau_command = setpoint_.tau;
  }
  [[nodiscard]] bool enabled() const { return driver_->feedback().drive_state == DriveState::enabled; }
  static double since(std::int64_t begin) { return static_cast<double>(ticks() - begin) * ns_per_tick() / kPerBatch; }
  // What is computed must be seen to be used.
  static void keep(std::uint8_t value) { asm volatile("" : : "r"(value) : "memory"); }

  config::DriveProtocol protocol_;
  std::unique_ptr<drivers::JointDriver> driver_;
  drivers::DriveSetpoint setpoint_{
      .q = 0.1F, .dq = 0.2F, .kp = 20, .kd = 0.5F, .tau = 0.5F};  // within one tick of none
  std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out_;
  std::vector<drivers::ReceivedFrame> replies_;
  drivers::WireGuard guard_;
  std::size_t joint_, bus_;
  drivers::GuardedMoment moment_;
  JointRecord record_;
};

std::vector<Exchange> one_per_protocol(const config::RobotConfig& robot) {
  std::vector<Exchange> exchanges;
  std::vector<config::DriveProtocol> seen;
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    const config::DriveProtocol protocol = robot.joints[joint].drive.protocol;
    if (std::ranges::find(seen, protocol) != seen.end()) continue;
    seen.push_back(protocol);
    exchanges.emplace_back(robot, joint);
  }
  return exchanges;
}

void measure(std::vector<Exchange>& exchanges) {
  const Pinned pinned(allowed_cpus().back());
  for (int batch = 0; batch < kBatches; ++batch) {
    for (Exchange& exchange : exchanges) {
      exchange.guard.push_back(exchange.guard_ns());
      exchange.encode.push_back(exchange.encode_ns());
      exchange.decode.push_back(exchange.decode_ns());
      exchange.both.push_back(exchange.encode.back() + exchange.decode.back());
    }
  }
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  using namespace takt::bench;
  CLI::App app{"Encode and decode per joint and tick, every drive protocol."};
  std::string robot_file = "config/dual_arm12.yaml";
  bool as_json = false;
  app.add_option("--robot", robot_file, "its protocols are measured");
  app.add_flag("--json", as_json, "one JSON row per figure");
  CLI11_PARSE(app, argc, argv);
  const auto robot = takt::config::load(robot_file);
  if (!robot) {
    fmt::print(stderr, "{}\n", robot.error());
    return takt::config::kExitBadConfiguration;
  }
  ns_per_tick();
  auto exchanges = one_per_protocol(*robot);
  measure(exchanges);
  const Report report(as_json);
  for (const Exchange& exchange : exchanges) {
    const double both = median(exchange.both), guard = median(exchange.guard);
    report.figure(fmt::format("{:<10} encode {:6.1f} ns  decode {:6.1f} ns  both {:6.1f} ns  {}  guard {:6.1f} ns  {}",
                              exchange.name(), median(exchange.encode), median(exchange.decode), both,
                              both <= kTarget_ns ? "(target 100: met)" : "(target 100: MISSED)", guard,
                              guard <= kGuardTarget_ns ? "(target 60: met)" : "(target 60: MISSED)"),
                  {{"bench", "codec"},
                   {"protocol", exchange.name()},
                   {"encode_ns", median(exchange.encode)},
                   {"decode_ns", median(exchange.decode)},
                   {"both_ns", both},
                   {"target_ns", kTarget_ns},
                   {"guard_ns", guard},
                   {"guard_target_ns", kGuardTarget_ns}});
  }
  return 0;
}
