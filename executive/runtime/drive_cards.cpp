// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/drive_cards.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>
#include <system_error>

#include "drivers/bus/can_frame.hpp"
#include "drivers/protocol/seen_angle.hpp"

namespace takt::runtime {
namespace {

using Json = nlohmann::ordered_json;

Json text_or_null(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}

Json json_of(const drivers::CardEntry& entry) {
  return {{"fact", drivers::name(entry.item)},
          {"value", text_or_null(entry.value)},
          {"expected", text_or_null(entry.expected)},
          {"source", text_or_null(entry.source)},
          {"verdict", drivers::name(entry.verdict)}};
}

// `seen`: what a person said of its scale; the drive does not tell it.
Json json_of(const config::Joint& joint, const std::string& interface, const drivers::DriveCard& card,
             const std::string& seen) {
  Json facts = Json::array();
  for (const drivers::CardEntry& entry : card.entries()) facts.push_back(json_of(entry));
  if (!seen.empty())
    facts.push_back(json_of(
        drivers::CardEntry{drivers::CardItem::scale, "takt joint jog", seen, {}, drivers::CardVerdict::agrees}));
  return {{"joint", joint.name},
          {"bus", interface},
          {"protocol", config::name(joint.drive.protocol)},
          {"id", joint.drive.id},
          {"watchdog_waiver", config::waives_watchdog(joint.drive) ? Json(joint.drive.watchdog_waiver) : Json(nullptr)},
          {"facts", std::move(facts)}};
}

}  // namespace

DriveCards::DriveCards(const config::RobotConfig& robot, ipc::SlotReader frames, const std::string& runtime_directory)
    : robot_(robot), frames_(frames), path_(runtime_directory + "/drives.json"), joints_of_bus_(robot.buses.size()) {
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    cards_.emplace_back(robot, joint);
    const auto angle = drivers::seen_angle(runtime_directory, robot, joint);
    seen_.push_back(angle ? drivers::text_of(robot.joints[joint].kind, *angle) : std::string());
    joints_of_bus_.at(robot.joints[joint].bus).push_back(joint);
  }
  write();
}

DriveCards::~DriveCards() {
  unlink(path_.c_str());
}

void DriveCards::catch_up() {
  bool changed = false;
  FrameRecord frame;
  while (frames_.read_next(std::as_writable_bytes(std::span(&frame, 1))).status == ipc::ReadStatus::fresh)
    changed |= take(frame);
  if (!changed) return;
  tell_differences();
  write();
}

bool DriveCards::take(const FrameRecord& record) {
  if (record.direction != FrameDirection::received || record.bus >= joints_of_bus_.size()) return false;
  const auto frame = drivers::from_record(record);
  if (!frame) return false;
  bool changed = false;
  for (const std::size_t joint : joints_of_bus_[record.bus]) changed |= cards_[joint].take(*frame);
  return changed;
}

void DriveCards::tell_differences() {
  for (std::size_t joint = 0; joint < cards_.size(); ++joint) {
    for (const drivers::CardEntry& entry : cards_[joint].entries()) {
      if (entry.verdict != drivers::CardVerdict::differs) continue;
      const std::string sentence =
          fmt::format("joint {}: the drive's {} is {}, and should be {} ({})", robot_.joints[joint].name,
                      drivers::name(entry.item), entry.value, entry.expected, entry.source);
      if (told_.insert(sentence).second) spdlog::warn("{}", sentence);
    }
  }
}

void DriveCards::write() const {
  Json drives = Json::array();
  for (std::size_t joint = 0; joint < cards_.size(); ++joint) {
    const config::Joint& known = robot_.joints[joint];
    drives.push_back(json_of(known, robot_.buses[known.bus].interface, cards_[joint], seen_[joint]));
  }
  const Json file{{"schema", "takt.drives/1"},
                  {"robot", robot_.robot},
                  {"config_sha256", robot_.sha256},
                  {"drives", std::move(drives)}};
  const std::string draft = path_ + ".new";
  std::ofstream out(draft, std::ios::trunc);
  out << file.dump(2) << '\n';
  out.close();
  if (!out || std::rename(draft.c_str(), path_.c_str()) != 0)
    spdlog::warn("{}: {}: what the drives say of themselves is not kept", path_,
                 std::generic_category().message(errno));
}

}  // namespace takt::runtime
