// What one joint's frames cost per tick, protocol by protocol: encode the command and decode the reply, host side.
//
// Method: the driver and the simulated drive of the first joint of each protocol in a robot file work together in
// virtual time until the drive is enabled; then one more exchange is kept, and its encode and its decode are timed in
// batches on one pinned thread, the protocols taking turns. Figures are per joint and tick: medians over the batches'
// means. Target: encode + decode <= 100 ns.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <memory>
#include <vector>

#include "config/load.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "simulation/device_table.hpp"
#include "tests/bench/bench.hpp"

namespace takt::bench {
namespace {

constexpr int kBatches = 2001, kPerBatch = 500;
constexpr int kPatience = 5000;  // ticks until enabled
constexpr double kTarget_ns = 100;

// A driver and its drive, enabled, with the frames of one exchange.
class Exchange {
 public:
  Exchange(const config::RobotConfig& robot, std::size_t joint) : protocol_(robot.joints[joint].drive.protocol) {
    driver_ = drivers::make_lone_driver(robot, joint).value();
    auto device = plant::make_device(robot.joints[joint].drive, milliseconds(100));
    MonoTime now = MonoTime{} + seconds(1);
    for (int tick = 0; tick < kPatience; ++tick, now = now + milliseconds(1)) {
      const bool was_enabled = enabled();
      const std::size_t sent = driver_->encode(tick > kPatience / 2, setpoint_, now, now + milliseconds(50), out_);
      plant::Frames answers;
      for (std::size_t i = 0; i < sent; ++i) device->receive(out_[i], now, answers);
      device->update({0.1, 0.2}, now, milliseconds(1), answers);
      replies_.clear();
      for (const drivers::CanFrame& answer : answers) {
        driver_->decode({answer, now});
        replies_.push_back({answer, now});
      }
      if (was_enabled && !replies_.empty()) return;
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
  [[nodiscard]] std::string_view name() const { return config::name(protocol_); }
  std::vector<double> encode, decode, both;

 private:
  [[nodiscard]] bool enabled() const { return driver_->feedback().drive_state == DriveState::enabled; }
  static double since(std::int64_t begin) { return static_cast<double>(ticks() - begin) * ns_per_tick() / kPerBatch; }
  // What is computed must be seen to be used.
  static void keep(std::uint8_t value) { asm volatile("" : : "r"(value) : "memory"); }

  config::DriveProtocol protocol_;
  std::unique_ptr<drivers::JointDriver> driver_;
  drivers::DriveSetpoint setpoint_{.q = 0.1F, .dq = 0.2F, .kp = 20, .kd = 0.5F, .tau = 1};
  std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out_;
  std::vector<drivers::ReceivedFrame> replies_;
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
    const double both = median(exchange.both);
    report.figure(fmt::format("{:<10} encode {:6.1f} ns  decode {:6.1f} ns  both {:6.1f} ns  {}", exchange.name(),
                              median(exchange.encode), median(exchange.decode), both,
                              both <= kTarget_ns ? "(target 100: met)" : "(target 100: MISSED)"),
                  {{"bench", "codec"},
                   {"protocol", exchange.name()},
                   {"encode_ns", median(exchange.encode)},
                   {"decode_ns", median(exchange.decode)},
                   {"both_ns", both},
                   {"target_ns", kTarget_ns}});
  }
  return 0;
}
