// SPDX-License-Identifier: Apache-2.0
// The way from a drive to its bus, and what can go wrong on it. Pure, virtual time; same seed, same losses.
// Without a fault every frame arrives at the instant it was said. Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "executive/contract/mono_time.hpp"
#include "simulation/device.hpp"

namespace takt::simulation {

// What is wrong with one drive's connection; each lasts until it is taken back.
struct LineFaults {
  bool deaf = false;          // hears nothing, so that a watchdog of its own trips
  bool silent = false;        // obeys; nothing it says arrives
  bool repeat = false;        // everything it says arrives twice
  Duration delay{};           // everything it says arrives this much later, in order
  double drop = 0;            // share of what it says that is lost, 0..1
  FeedbackFaults feedback{};  // what it says is wrong; joint side, of a slide its motor
  bool operator==(const LineFaults&) const = default;
};

class ReplyPath {
 public:
  static constexpr std::size_t kMaxOnTheWay = 4096;  // what a drive says beyond it is lost

  explicit ReplyPath(std::uint64_t seed) : random_(seed) {}
  void set(const LineFaults& faults) { faults_ = faults; }
  [[nodiscard]] const LineFaults& faults() const { return faults_; }
  [[nodiscard]] bool is_empty() const { return on_the_way_.empty(); }
  // Whatever the drive says arrives as it is said: nothing is wrong, and nothing that was said before is to come.
  [[nodiscard]] bool is_clear() const { return is_empty() && faults_ == LineFaults{}; }
  // What the drive says now.
  void take(const Frames& said, MonoTime now);
  // Appends what has arrived by now. What was on its way when a fault began or ended still arrives, in the order it
  // was said.
  void deliver(MonoTime now, Frames& arrived);

 private:
  struct OnTheWay {
    drivers::CanFrame frame;
    MonoTime due;
  };
  bool is_lost();

  LineFaults faults_;
  std::vector<OnTheWay> on_the_way_;  // in the order said: who is due waits for those before
  std::mt19937_64 random_;
};

}  // namespace takt::simulation
