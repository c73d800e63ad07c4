// SPDX-License-Identifier: Apache-2.0
// <runtime-dir>/drives.json: what every drive said of itself while it was set up (drivers/protocol/drive_card.hpp).
// Read from the executive's own frame ring, behind the control thread's back. Written when the executive starts and
// whenever a card changes, removed when it ends; the monitor keeps a copy in the run folder. Schema takt.drives/1:
//   robot, config_sha256, drives [{joint, bus (interface), protocol, id, watchdog_waiver (null: none),
//   facts [{fact, value (null: unknown), expected (null: nothing), source (null: the protocol cannot tell it),
//   verdict (told, agrees, differs, waived, unknown)}]}]
// A fact that differs is logged, once for each value. Thread rule: service thread.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/protocol/drive_card.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::runtime {

class DriveCards {
 public:
  // `robot` outlives it.
  DriveCards(const config::RobotConfig& robot, ipc::SlotReader frames, const std::string& runtime_directory);
  DriveCards(const DriveCards&) = delete;
  DriveCards& operator=(const DriveCards&) = delete;
  ~DriveCards();

  // Reads every frame that was published since. A file that cannot be written is logged, and tried again at the next
  // change.
  void catch_up();

 private:
  bool take(const FrameRecord& frame);
  void tell_differences();
  void write() const;

  const config::RobotConfig& robot_;
  ipc::SlotReader frames_;
  std::string path_;
  std::vector<drivers::DriveCard> cards_;                // one per joint
  std::vector<std::string> seen_;                        // by a person, one per joint; empty: nothing
  std::vector<std::vector<std::size_t>> joints_of_bus_;  // indices into cards_
  std::set<std::string> told_;                           // sentences
};

}  // namespace takt::runtime
