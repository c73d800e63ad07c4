// SPDX-License-Identifier: Apache-2.0
#include "config/drive_ids.hpp"

namespace takt::config {
namespace {

constexpr std::uint32_t kDamiaoRegisters = 0x7FF, kAkV3Feedback = 0x2900, kCia402HostNode = 127;

IdPattern standard(std::uint32_t id) {
  return {id, 0x7FF, false};
}

std::vector<IdPattern> each_of(std::initializer_list<std::uint32_t> ids) {
  std::vector<IdPattern> patterns;
  for (const std::uint32_t id : ids) patterns.push_back(standard(id));
  return patterns;
}

DriveIds of_mit(const Drive& drive) {
  DriveIds ids{each_of({drive.id}), {}, each_of({drive.reply_id}), {}};
  // Bits 8 to 10 are a mode, bits 0 to 7 its number: it obeys them all.
  if (drive.variant == "robstride") ids.commands = {{drive.id, 0xFF, false}};
  if (drive.variant == "damiao") ids.broadcasts = each_of({kDamiaoRegisters});
  if (drive.variant == "tmotor") ids.betrayals = {{kAkV3Feedback | drive.id, 0x1FFF'FFFF, true}};
  return ids;
}

// 29 bits: type 5 | data 16 | target 8. To the drive: target is its number. From it: target is the host, or FE in the
// answer to "get id" (type 0), and the data's low byte is the drive.
DriveIds of_robstride(const Drive& drive) {
  constexpr std::uint32_t kAllBits = 0x1FFF'FFFF;
  return {{{drive.id, 0xFF, true}},
          {},
          {{drive.id << 8 | drive.host_id, 0xFFFF, true}, {drive.id << 8 | 0xFE, kAllBits & ~0x00FF'0000U, true}},
          {}};
}

// 11 bits: node 6 | command 5.
DriveIds of_odrive(const Drive& drive) {
  const auto all = [&drive](std::initializer_list<std::uint32_t> commands) {
    std::vector<IdPattern> patterns;
    for (const std::uint32_t command : commands) patterns.push_back(standard(drive.id << 5 | command));
    return patterns;
  };
  return {all({0x02, 0x07, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F, 0x18, 0x19}),
          {},
          all({0x00, 0x01, 0x03, 0x09, 0x14, 0x15, 0x17, 0x1C}),
          {}};
}

// Source and destination in a byte each; the source's top bit asks for a reply. We are number 0. A reply's id fits into
// 11 bits when the drive's number is small, and comes as either kind.
DriveIds of_moteus(const Drive& drive) {
  DriveIds ids{{{drive.id, 0x1FFF'7FFF, true}}, {}, {{drive.id << 8, 0x1FFF'FFFF, true}}, {}};
  if (drive.id << 8 <= 0x7FF) ids.replies.push_back(standard(drive.id << 8));
  return ids;
}

DriveIds of_cia402(const Drive& drive) {
  const std::uint32_t n = drive.id;
  return {each_of({0x200 + n, 0x300 + n, 0x400 + n, 0x500 + n, 0x600 + n}),
          each_of({0x000, 0x080, 0x700 + kCia402HostNode}),
          each_of({0x080 + n, 0x180 + n, 0x280 + n, 0x380 + n, 0x480 + n, 0x580 + n, 0x700 + n}),
          {}};
}

}  // namespace

DriveIds ids_of(const Drive& drive) {
  switch (drive.protocol) {
    case DriveProtocol::mit:
      return of_mit(drive);
    case DriveProtocol::robstride:
      return of_robstride(drive);
    case DriveProtocol::odrive:
      return of_odrive(drive);
    case DriveProtocol::moteus:
      return of_moteus(drive);
    case DriveProtocol::cia402:
      return of_cia402(drive);
  }
  return {};
}

}  // namespace takt::config
