// SPDX-License-Identifier: Apache-2.0
#include "simulation/bus_trouble.hpp"

#include <algorithm>
#include <array>

#include "config/drive_ids.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "simulation/chance.hpp"

namespace takt::simulation {
namespace {

// A classic frame without data, interframe space included, before stuffing.
constexpr double kBitsOfEmptyFrame = 47;
constexpr std::uint64_t kSeedPlace = 1000;  // beyond every joint's

// The lowest standard id that no drive of the bus hears or speaks: it wins every arbitration that it can.
std::uint32_t id_of_nobody(const config::RobotConfig& robot, std::size_t bus) {
  std::vector<config::IdPattern> taken;
  for (const config::Joint& joint : robot.joints) {
    if (joint.bus != bus) continue;
    const config::DriveIds ids = config::ids_of(joint.drive);
    for (const auto* some : {&ids.commands, &ids.broadcasts, &ids.replies})
      taken.insert(taken.end(), some->begin(), some->end());
  }
  std::uint32_t id = 0;
  while (id < 0x7FF && std::ranges::any_of(taken, [id](const auto& one) { return one.matches(id, false); })) ++id;
  return id;
}

}  // namespace

BusTrouble::BusTrouble(const config::RobotConfig& robot, std::size_t bus)
    : robot_(robot), random_(seed_for(robot.simulation->seed, kSeedPlace + bus)) {
  babble_.id = id_of_nobody(robot, bus);
  const double per_step = robot.buses[bus].bitrate * robot.simulation->step.seconds() / kBitsOfEmptyFrame;
  babble_per_step_ = std::clamp<std::size_t>(static_cast<std::size_t>(per_step), 1, kMostFramesPerStep);
}

void BusTrouble::set(const BusFaults& faults) {
  faults_ = faults;
  std::erase_if(rivals_, [&](const Rival& rival) {
    return std::ranges::find(faults.rivals_of, rival.joint) == faults.rivals_of.end();
  });
  for (const std::size_t joint : faults.rivals_of) {
    if (std::ranges::find(rivals_, joint, &Rival::joint) != rivals_.end()) continue;
    if (auto host = drivers::make_joint_driver(robot_, joint)) rivals_.push_back({joint, std::move(*host)});
  }
}

bool BusTrouble::loses() {
  return happens(faults_.drop, random_);
}

void BusTrouble::speak(Frames& out) {
  if (faults_.babble) out.insert(out.end(), babble_per_step_, babble_);
  for (const Rival& rival : rivals_) {
    std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> frames;
    const std::size_t count = rival.host->encode(true, {}, {}, {}, frames);
    out.insert(out.end(), frames.begin(), frames.begin() + static_cast<std::ptrdiff_t>(count));
  }
}

void BusTrouble::overhear(const drivers::CanFrame& frame, MonoTime now) {
  for (const Rival& rival : rivals_) rival.host->decode({frame, now});
}

}  // namespace takt::simulation
