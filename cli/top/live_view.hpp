// SPDX-License-Identifier: Apache-2.0
// What is known about a running robot right now, gathered from its record rings: the model behind `takt top`.
//
// Fed like a recorder, in order; asked with the reader's clock, which is the executive's (CLOCK_MONOTONIC). Memory is
// bounded by the robot and kWindow. Pure: no clock, no I/O. Thread rule: one thread at a time.
#pragma once

#include <array>
#include <deque>
#include <string>
#include <vector>

#include "cli/top/picture.hpp"
#include "cli/top/rate_meter.hpp"
#include "config/robot_config.hpp"
#include "executive/contract/session.hpp"
#include "monitor/record/run_messages.hpp"
#include "monitor/telemetry/live_metrics.hpp"

namespace takt::monitor::top {

inline constexpr Duration kSlice = milliseconds(250);
inline constexpr std::size_t kSlices = 240;
inline constexpr Duration kWindow = seconds(10);
inline constexpr Duration kSilentAfter = milliseconds(500);

class LiveView {
 public:
  explicit LiveView(const config::RobotConfig& robot);

  // A session of the executive begins: everything but the history starts anew.
  void begin();
  // There is no session, for this reason.
  void wait(std::string why);
  void status(const OperatorReply& reply);
  void tick(const TickRecord& record);
  void frame(const FrameRecord& frame);
  void loss(const Loss& loss);

  [[nodiscard]] Picture picture(MonoTime now) const;

 private:
  struct Aged {
    MonoTime at;
    std::int64_t age_ns;
  };
  struct Staged {
    MonoTime at;
    std::array<std::int64_t, kAgeStageCount> parts_ns;
  };
  // What one session leaves behind.
  struct Session {
    explicit Session(const config::RobotConfig& robot);
    LiveMetrics metrics;
    std::deque<Aged> ages;
    std::deque<Staged> stages;
    std::vector<std::array<MonoTime, kInterventionCount>> intervened_at;  // per joint
    std::vector<RateMeter> wire_seconds;                                  // per bus: time taken by frames
    RateMeter accepted;
    MonoTime mode_since;
    Cause entered_by = Cause::none;
    std::uint64_t lost_ticks = 0;
    incident::IncidentWatch incidents;
    OperatorReply reply;
    bool has_status = false;
  };

  void remember_ages(const TickRecordHeader& header);
  void remember_slice(const TickRecordHeader& header);
  [[nodiscard]] std::vector<Slice> history(MonoTime now) const;
  [[nodiscard]] std::string incident() const;
  void describe_policy(Picture& picture, MonoTime now) const;
  [[nodiscard]] std::vector<BusPicture> buses(MonoTime now) const;
  [[nodiscard]] std::vector<JointPicture> joints() const;

  config::RobotConfig robot_;
  std::vector<double> planned_loads_;  // per bus; empty: not known
  Session session_;
  bool attached_ = false;
  std::string why_ = "not attached yet";
  std::deque<Slice> slices_;
  std::int64_t newest_slice_ = 0;  // its number: time / kSlice
};

}  // namespace takt::monitor::top
