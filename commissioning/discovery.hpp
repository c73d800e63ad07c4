// SPDX-License-Identifier: Apache-2.0
// Who is on a bus: what to ask a drive so that it tells who it is without moving or enabling anything, and how to read
// its answer. One row per protocol in discovery.cpp. Pure.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/bus/can_bus.hpp"
#include "executive/contract/feedback.hpp"

namespace takt::commissioning {

struct Found {
  std::uint32_t id = 0;  // as `id` in the robot file
  std::string what;      // one thing it said about itself, such as "PMAX 12.5 rad"; empty: only that it is there
  // Which question this answers, by the protocol's own number; nothing: it was not asked.
  std::optional<std::uint32_t> question{};
  std::string other_protocol{};  // that it speaks, and Takt does not; empty: none
};

// Frames to ask the drive with this number with; none: its protocol's drives speak by themselves.
std::vector<drivers::CanFrame> questions_to(config::DriveProtocol protocol, std::uint32_t id);
// What a drive of the robot file is asked besides, since to another protocol's drive it may mean anything. T-Motor
// drives answer commands only; the one that disables is harmless to a drive not in use. A Damiao that speaks CAN
// FD is asked in it, and an ODrive for its version.
std::vector<drivers::CanFrame> own_questions(const config::Drive& drive, const config::Bus& bus);
// What a drive of that protocol said; nothing: the frame is not one it would send.
std::optional<Found> read_answer(config::DriveProtocol protocol, const drivers::CanFrame& frame);

// Make the drive's present position its zero, sent in this order; none: the protocol has no such frame, or none that
// outlives power-on (home_place.hpp). The drive must be disabled. A RobStride forgets its zero with its supply unless
// it is told to save (type 22, data 01 to 08; source: motorbridge.seeedstudio.com, RobStride parameter tables), which a
// CyberGear does not know.
std::vector<drivers::CanFrame> zero_frames(const config::Drive& drive);

// A scan of one bus: hands out questions one by one and collects answers. For drives that speak by themselves it only
// listens, so let it listen for kListen after the last question.
inline constexpr Duration kListen = milliseconds(500);
class BusScan {
 public:
  // Ids first..last of every protocol.
  BusScan(const std::set<config::DriveProtocol>& protocols, std::uint32_t first, std::uint32_t last);

  void also_ask(const drivers::CanFrame& question);

  std::optional<drivers::CanFrame> next_question();
  void take(const drivers::CanFrame& frame);

  struct Drive {
    config::DriveProtocol protocol = config::DriveProtocol::mit;
    std::uint32_t id = 0;
    std::set<std::string> said;
    std::set<std::uint32_t> reply_ids;         // of the frames in which it answered
    bool classic = false, fd = false;          // in which form
    std::set<std::string> other_protocols;     // that it speaks, and Takt does not
    std::map<std::uint32_t, int> answers;      // to each question
    [[nodiscard]] bool answers_twice() const;  // one question: there are two drives of that number
  };
  // By protocol and id.
  [[nodiscard]] std::vector<Drive> found() const;
  [[nodiscard]] std::size_t questions() const { return questions_.size(); }

 private:
  std::set<config::DriveProtocol> protocols_;
  std::uint32_t first_, last_;
  std::vector<drivers::CanFrame> questions_;
  std::size_t asked_ = 0;
  std::map<std::pair<config::DriveProtocol, std::uint32_t>, Drive> found_;
};

// What of a joint's drive is not as the robot file has it, a sentence each; empty: all is, as far as it was seen.
// `found`: what a scan heard of it; null: nothing. `feedback`: of its driver, once it tried to set the drive up,
// disabled.
std::vector<std::string> differences(const config::Joint& joint, const BusScan::Drive* found,
                                     const JointFeedback& feedback);

}  // namespace takt::commissioning
