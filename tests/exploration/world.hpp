// SPDX-License-Identifier: Apache-2.0
// A whole robot in one thread and virtual time: the executive's own cyclic loop and drivers, in front of ports that
// belong to a world in which drives of every protocol turn flywheels, frames take their time, a policy answers and an
// operator insists on moving. Whatever waits, reads the clock, sends or receives lets time pass, and a stall may strike
// there.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/ipc/slot_ring.hpp"
#include "executive/runtime/cyclic_loop.hpp"
#include "simulation/plant.hpp"
#include "tests/exploration/schedule.hpp"

namespace takt::exploration {

inline constexpr MonoTime kStart{1'000'000'000'000};
inline constexpr Duration kOnTheWire = microseconds(130);  // of a frame, each way
// Share of the robot's default gains that the policy asks for: by its ratio kp / kd a frame says whose it is.
inline constexpr float kPolicyKp = 0.8F, kPolicyKd = 0.5F, kFallbackKd = 0.3F, kCandidateKd = 0.4F;
inline constexpr float kLittle = 0.1F;  // share of the default gains, where an event leaves only little of them

// A fault of the executive's own, put between its drivers and the bus, so that oracles can be seen to bite.
enum class Planted : std::uint8_t {
  none,
  old_frames,     // while the policy is silent, what was sent before leaves again
  sign,           // a drive without position control is pushed the wrong way
  stays_enabled,  // what disables a drive does not leave
  doubled_torque,
  no_stop,           // the operator's stop is not heard
  deaf_to_recorder,  // a recorder that ended is believed to write on
  wide_frames,       // asks for positions outside of every limit
  pushes_unheard,    // a silent drive is pushed instead of disabled
  swings_on,         // a drive without position control is pushed to and fro in a damped stop
  keeps_torque,      // the output that permits torque never takes it, and says it did
  refused,           // the guard finds one frame of a tracking robot to be another than was decided
  // Of what the tick is told of stops and degraded mode:
  stops_without_end,     // no way of stopping ends by its time
  degraded_without_end,  //
  stiff_damping,         // a stop that damps for good holds
  policy_in_any_stop,    // whatever stops the robot, the fallback policy goes on
  // Of what the tick is told of limits and rest:
  led_when_lost,  // degraded mode leads the robot to a pose half a radian away
  fast_limits,    // velocity is three times as large, acceleration 1.8 times
  sudden_limits,  // acceleration is ten times as large
  early_rest,     // a joint rests at 5 rad/s
};

// One drive of each protocol, on flywheels; no gravity; an output that permits torque; an IMU in the base.
config::RobotConfig small_robot();
// The same, which a hot drive degrades, and which is stopped when it was degraded for 0.2 s.
config::RobotConfig robot_that_minds();
// The same, whose MIT and RobStride drives are written to every third and second tick.
config::RobotConfig robot_with_turns();
// The same with a fallback policy, which may move it for a second at one go.
config::RobotConfig robot_with_fallback();
// The same, whose stops and degraded mode are drawn from a seed: for every cause of a stop one of the ways to stop that
// it may have, for so long; what degraded mode does, and for how long. Its one pose is home.
config::RobotConfig robot_that_stops(std::uint64_t seed);
// One of those, on top with a join, a mode of its CiA 402 drive, and for every other seed limbs, drawn from the seed:
// links without mass, the second joint on the first, the fourth on the third, so that what is lost is not the whole
// robot.
config::RobotConfig robot_at_random(std::uint64_t seed);

class World {
 public:
  World(const config::RobotConfig& robot, std::vector<Event> events, std::uint64_t seed,
        Planted planted = Planted::none);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  struct Sent {
    std::size_t bus;
    drivers::CanFrame frame;
    MonoTime at;
  };
  // What is watched: every frame as it is written, every tick once it is recorded, the true state after each step.
  std::function<void(const Sent&)> on_frame;
  std::function<void(const TickRecord&)> on_tick;
  std::function<void()> on_step;

  void run(Duration lasting);

  [[nodiscard]] MonoTime now() const { return now_; }
  [[nodiscard]] simulation::Plant& plant() { return plant_; }
  [[nodiscard]] const config::RobotConfig& robot() const { return robot_; }
  // Since when nothing this joint says arrives; unset: it is heard.
  [[nodiscard]] MonoTime unheard_since(std::size_t joint) const { return unheard_since_[joint]; }
  [[nodiscard]] MonoTime shoved_at(std::size_t joint) const { return shoved_at_[joint]; }
  // When a hand held or pulled it last; unset: never.
  [[nodiscard]] MonoTime handled_at(std::size_t joint) const { return handled_at_[joint]; }
  // Newest instant at which its feedback lied and had not to be found yet.
  [[nodiscard]] MonoTime lied_at(std::size_t joint) const { return lied_at_[joint]; }
  // Nothing is wrong with what it hears and does, nor with its bus; hands, shoves and lies are another matter.
  [[nodiscard]] bool is_well(std::size_t joint) const;
  // Policies ask for their usual gains.
  [[nodiscard]] bool has_usual_gains(std::size_t joint) const;
  // No policy leaves its damping out.
  [[nodiscard]] bool is_damped(std::size_t joint) const;
  // It hears us: nothing is wrong with the way from the executive to this drive.
  [[nodiscard]] bool obeys(std::size_t joint) const;
  // The executive wakes and works in time.
  [[nodiscard]] bool is_prompt() const { return now_ - last_tick_at_ < config_.period * 2; }
  [[nodiscard]] MonoTime stop_asked_at() const { return stop_asked_at_; }
  [[nodiscard]] MonoTime power_off_asked_at() const { return power_off_asked_at_; }
  // When the planted guard refused its frame; unset: it did not.
  [[nodiscard]] MonoTime refused_at() const { return refused_at_; }
  // By the output that permits it, whatever the drives do.
  [[nodiscard]] bool is_torque_permitted() const { return torque_permitted_; }
  [[nodiscard]] bool torque_output_works() const { return active(Happening::torque_output_fails) == nullptr; }
  [[nodiscard]] bool is_recorded() const { return active(Happening::recorder_ends) == nullptr; }
  // When the oldest sample was taken of the newest observation that any command published by this one of the policies
  // answers; unset before.
  [[nodiscard]] MonoTime newest_answered(Player player) const {
    if (player == Player::candidate) return candidate_ ? candidate_->newest_answered : MonoTime{};
    return player == Player::fallback ? fallback_.newest_answered : policy_.newest_answered;
  }

 private:
  class VirtualClock;
  class VirtualBus;
  class PlantedGuard;
  class VirtualTorque;
  class LyingDriver;
  struct Mailbox;
  struct Rings;
  struct Arriving {
    drivers::ReceivedFrame frame;
    MonoTime readable_at;
  };
  struct Answer {
    MonoTime due;
    std::size_t bytes;
    std::unique_ptr<CommandChunk> chunk;
    MonoTime sensed;
  };
  // One of the three, behind its mailbox.
  struct Policy {
    Policy(Mailbox& mailbox, runtime::MailboxHandover& handover, std::uint64_t policy_hash, Happening what_silences,
           float kd_share);
    std::uint64_t hash;
    Happening silence;
    float kd;  // share of the robot's default gains that it asks for
    ipc::SlotWriter& commands;
    std::deque<Answer> answers{};
    std::uint64_t sequence = 0;
    MonoTime newest_answered{};
  };
  void pass(Duration time) { go_to(now_ + time); }
  void go_to(MonoTime until);
  void advance_to(MonoTime at);  // of the plant
  void stall_in(Happening port);
  void fall_asleep(Happening when);
  void begin_and_end_events();
  void push(std::size_t joint, double speed);
  void lend_a_hand();
  void note_lies();
  void disable_from_outside(std::size_t joint);
  void set_lines();
  void sense_base();
  void collect(std::size_t bus);
  void arrive(std::size_t bus, const simulation::Frames& said);
  void heat(std::size_t bus, drivers::CanFrame& frame) const;
  void let_policies_work();
  void let_work(Policy& policy, bool observes);
  void answer(Policy& policy, const Observation& observation);
  // Of the default gains, or rad for asks_far: what events leave of the policies' wishes.
  [[nodiscard]] float share(float usual, Happening none, Happening little, std::size_t joint) const;
  void before_tick();
  [[nodiscard]] bool is_active(const Event& event) const;
  [[nodiscard]] bool may_be_on(Happening what) const {  // cheap, and seldom true
    return (active_ >> static_cast<unsigned>(what) & 1U) != 0;
  }
  [[nodiscard]] const Event* active(Happening what) const;
  [[nodiscard]] const Event* lie_of(std::size_t joint) const;
  [[nodiscard]] bool is_on(Happening what, std::size_t index) const;
  [[nodiscard]] bool loses_frame(std::size_t bus);
  drivers::SendResult send(std::size_t bus, drivers::CanFrame frame);
  [[nodiscard]] bool is_of_mit(std::uint32_t id) const;
  // False: the frame does not leave.
  bool plant_fault_in(drivers::CanFrame& frame);
  [[nodiscard]] runtime::DriveEdge make_edge();

  const config::RobotConfig& robot_;
  std::vector<Event> events_;
  std::vector<bool> done_;    // by event: what strikes once has struck
  std::uint64_t drawn_ = 0;   // Happenings of the schedule, one bit each
  std::uint64_t active_ = 0;  // of them, those that last at plant_at_
  bool lies_ = false;         // the schedule has a lie
  bool has_lines_ = false;    // one of the drives' connections is not well, or was not a step ago
  std::mt19937_64 random_;
  Planted planted_;
  bool torque_permitted_ = false;
  MonoTime now_ = kStart;
  simulation::Plant plant_;
  MonoTime plant_at_ = kStart;
  Duration slept_;
  std::vector<std::deque<Arriving>> arriving_;  // by bus
  std::vector<MonoTime> unheard_since_, shoved_at_, handled_at_, lied_at_;
  std::vector<double> held_at_;                             // rad, where a hand holds the joint; NaN: none does
  std::map<std::uint32_t, drivers::CanFrame> last_frames_;  // by id; for planted faults
  simulation::Frames said_;

  pipeline::TickConfig config_;
  std::unique_ptr<VirtualClock> clock_;
  runtime::DriveEdge edge_;
  PerSeat<runtime::MailboxHandover> mailboxes_;
  runtime::OperatorInbox requests_;
  runtime::RecordedThrough recorded_;
  runtime::StatusBoard board_;
  std::unique_ptr<Rings> rings_;
  ipc::SlotReader ticks_, observations_;
  std::vector<std::unique_ptr<CommandChunk>> spare_chunks_;  // large: used again and again
  Policy policy_, fallback_;
  std::unique_ptr<Policy> candidate_;  // where the schedule has one
  runtime::Handover<runtime::ImuMailbox> imu_mailboxes_;
  std::uint64_t imu_sequence_ = 0;
  std::unique_ptr<runtime::CyclicLoop> loop_;
  TickRecord record_{};
  Observation observation_;
  MonoTime stop_asked_at_, power_off_asked_at_, refused_at_, asked_at_, last_tick_at_;
};

}  // namespace takt::exploration
