// SPDX-License-Identifier: Apache-2.0
// What must hold of a robot under Takt, judged from frames and true motion alone, by books of its own: nothing here
// knows the executive's setpoints, and frames are read by the drives' protocol papers (mit, odrive), not by our codecs.
// Each oracle:
//
// command_age    no frame with a policy's gains is written when the newest observation that this policy answered is
//                older than max_age
// player         the tick says whose gains its frames have
// frame_limits   position, speed, gains and torque that a frame asks for are inside the robot's limits, to a quantum
// torque_slew    torque commands follow one another within torque_rate, or fall to zero
// no_push        a joint that is not heard any more gets no faster by our doing
// stop_wins      from the second tick after the operator's stop on, nothing tracks; after power off, it is standby
// recorded       the robot never tracks for more than two ticks while nothing is recorded
// standby_still  what is in standby and hears us is not enabled
// torque_off     from the second tick in standby on, the output that permits torque does not, unless it is broken
// comes_to_rest  two seconds after a damped stop began, or was left by the fallback policy, undisturbed joints rest
// stop_by_policy in a damped stop the fallback policy moves the robot only while the stop's way is its (stop_book.hpp)
// stop_ends      a joint is stiff in a damped stop only while its way says so, or once the joint has rested in it
// reset_waits    nothing takes the power of a robot that the fallback policy moves
// degraded_ends  the robot is not degraded for longer than degraded.for
// no_bug         the executive never finds an error of its own, and its guard refuses nothing that it decided
// speed          without a shove no joint is faster than velocity_hard
//
// On true motion, of joints with which nothing is wrong; what a hand or a shove gives a joint is not our doing:
//
// thrown         where no policy plays (degraded and held, stopped, arming, standby) no joint gets faster than it was
// too_fast       no joint gets faster than 1.1 times limits.velocity, when a hand lets go neither; 1.3 times while a
//                policy plays, whose damping here is half of the robot's (and see kPlayedJointsYieldToHands)
// too_sudden     no joint gets faster by more than twice limits.acceleration, taken over 40 ms
// reset_rests    a reset takes the power of no joint that is heard and moves
#pragma once

#include <array>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tests/exploration/stop_book.hpp"
#include "tests/exploration/world.hpp"

namespace takt::exploration {

// Whether a joint that a hand lets go of while a policy plays may be no faster than too_fast says. As yet the policy's
// stiffness throws it with up to the torque limit, as it would push anything: true here asks for more.
inline constexpr bool kPlayedJointsYieldToHands = false;

class Oracles {
 public:
  // Watches `world`, which outlives this, from now on.
  explicit Oracles(World& world);
  // The first broken promise: "command_age: ..."; empty: none.
  [[nodiscard]] const std::string& broken() const { return broken_; }
  // Which cause led out of which mode.
  [[nodiscard]] const std::set<std::pair<Mode, Cause>>& seen() const { return seen_; }
  [[nodiscard]] const StopBook::Met& ways() const { return book_.met(); }

 private:
  struct Asked {  // by one frame, joint side
    double q = 0, dq = 0, kp = 0, kd = 0, tau = 0;
  };
  struct Watched {
    double allowed_speed = -1;  // < 0: not limited at present
    double last_torque = 0;
    std::uint64_t last_torque_tick = 0;
    bool torque_known = false;
    MonoTime disturbed_at;
    int standby_ticks = 0;
    bool stiff = false;               // in a frame since the last tick was recorded
    MonoTime calm_since, rested_at;   // by its true motion; unset: it moves, it never rested
    MonoTime ill_at, touched_at;      // something was wrong with it; a hand or a shove moved it
    double carried = 0;               // rad/s, what is left of a speed that was not our doing
    double let_go = 0;                // rad/s, its speed when no policy played any more
    double led = -1;                  // rad/s, how fast it may be where no policy plays; < 0: not known
    std::array<double, 40> speeds{};  // rad/s, of the last steps, signed
    MonoTime unusual_gains_at, undamped_at, swung_at, played_at, powered_at, moving_since;
  };
  void frame(const World::Sent& sent);
  void mit_frame(std::size_t joint, const World::Sent& sent);
  void odrive_frame(std::size_t joint, const World::Sent& sent);
  void step();
  void tick(const TickRecord& record);
  void watch_unheard(std::size_t joint, double speed);
  void watch_rest(std::size_t joint, double speed);
  void watch_stop(const TickRecordHeader& header);
  void watch_motion(std::size_t joint, double velocity);
  void watch_reset(const TickRecordHeader& header);
  [[nodiscard]] bool lies_now() const;  // or did within the last second
  void breaks(const char* oracle, std::size_t joint, const std::string& how);

  World& world_;
  std::vector<Watched> joints_;
  MonoTime last_frame_at_, damped_since_;
  std::uint64_t ticks_ = 0;
  int unrecorded_ticks_ = 0, permitted_ticks_ = 0;
  Mode mode_ = Mode::standby;
  Player player_ = Player::none;
  std::size_t steps_ = 0;
  bool has_lied_ = false;              // a lie has led to an error of our own, which stays until it is reset
  Player seen_player_ = Player::none;  // by the gains of the frames since the last tick was recorded
  StopBook book_;
  std::string broken_;
  std::set<std::pair<Mode, Cause>> seen_;
};

}  // namespace takt::exploration
