// SPDX-License-Identifier: Apache-2.0
// Drives that are set up otherwise than a robot file says, one planted difference a row, and what must be said of it:
// for drivers (misconfigured_drives_test.cpp) and for the tools of the person at the robot
// (planted_for_tools_test.cpp). The difference is in the simulated drive itself, or, where it is the simulator's habit
// to be right, in its word on the wire. The sentences were written down here from the settings' names in the makers'
// manuals.
#pragma once

#include <cstring>
#include <functional>
#include <memory>
#include <ostream>
#include <vector>

#include "commissioning/home_place.hpp"
#include "config/drive_presets.hpp"
#include "simulation/cia402_device.hpp"
#include "simulation/device_table.hpp"
#include "simulation/moteus_device.hpp"

namespace takt::simulation::misconfigured {

using config::Drive;
using drivers::CanFrame;

struct Planted {
  std::unique_ptr<Device> device;
  std::function<bool(CanFrame&)> on_the_way;  // false: lost
};

struct Row {
  const char* when;
  Drive file;  // as the robot file has it
  std::function<Planted(const Drive&)> plant;
  const char* sentence;  // part of it; empty: arms
  friend void PrintTo(const Row& row, std::ostream* out) { *out << row.when; }
};

inline Drive packed(config::DriveProtocol protocol, const char* model, const char* variant = "") {
  const config::DrivePreset& preset = *config::find_drive_preset(protocol, model);
  Drive drive;
  drive.protocol = protocol;
  drive.model = model;
  drive.variant = variant;
  drive.id = 3;
  drive.reply_id = 0x13;
  drive.host_id = 253;
  drive.position_range = preset.position;
  drive.velocity_range = preset.velocity;
  drive.torque_range = preset.torque;
  drive.kp_range = preset.kp;
  drive.kd_range = preset.kd;
  return drive;
}

inline Drive with(Drive drive, const std::function<void(Drive&)>& change) {
  change(drive);
  return drive;
}
inline const auto kWaived = [](Drive& drive) { drive.watchdog_waiver = "the simulated drive's is set"; };

// Of the drive that the robot file means.
inline std::function<void(Drive&)> named(const char* identity, const char* firmware = "any") {
  return [identity, firmware](Drive& drive) {
    drive.identity = identity;
    drive.firmware = firmware;
  };
}

inline Drive damiao() {
  return packed(config::DriveProtocol::mit, "DM4310", "damiao");
}
inline Drive tmotor() {
  return with(packed(config::DriveProtocol::mit, "AK10-9", "tmotor"), kWaived);
}
// Its ranges stand in for those of the maker's table of that protocol.
inline Drive robstride_in_mit() {
  return with(packed(config::DriveProtocol::mit, "AK10-9", "robstride"), kWaived);
}
inline Drive robstride(const char* model = "RS03") {
  return packed(config::DriveProtocol::robstride, model);
}
inline Drive own_units(config::DriveProtocol protocol) {
  Drive drive;
  drive.protocol = protocol;
  drive.id = 3;
  drive.torque_range = 3;
  drive.servo_kp = 20;
  drive.servo_kd = 1;
  drive.counts_per_turn = 1 << 17;
  drive.rated_torque = 10;
  return drive;
}
inline Drive odrive() {
  return with(own_units(config::DriveProtocol::odrive), kWaived);
}
inline Drive moteus() {
  return own_units(config::DriveProtocol::moteus);
}
inline Drive servo(config::Cia402Mode mode = config::Cia402Mode::cst) {
  Drive drive = own_units(config::DriveProtocol::cia402);
  drive.mode = mode;
  return drive;
}

inline std::function<Planted(const Drive&)> as_delivered(Duration watchdog = milliseconds(100)) {
  return [watchdog](const Drive& file) { return Planted{make_device(file, watchdog), {}}; };
}
// The drive differs from the robot file.
inline std::function<Planted(const Drive&)> built(const std::function<void(Drive&)>& change) {
  return [change](const Drive& file) { return Planted{make_device(with(file, change), milliseconds(100)), {}}; };
}
// Its word on the wire differs from what the simulated drive would say.
inline std::function<Planted(const Drive&)> saying(std::function<bool(CanFrame&)> otherwise,
                                                   Duration watchdog = milliseconds(100)) {
  return [otherwise, watchdog](const Drive& file) { return Planted{make_device(file, watchdog), otherwise}; };
}
inline std::function<Planted(const Drive&)> servo_with(const Cia402Profile& profile) {
  return [profile](const Drive& file) {
    return Planted{std::make_unique<Cia402Device>(file, Duration{}, profile), {}};
  };
}
inline std::function<Planted(const Drive&)> moteus_at_home(int state) {
  return [state](const Drive& file) {
    return Planted{std::make_unique<MoteusDevice>(file, milliseconds(100), state), {}};
  };
}

inline const auto kIncremental = [](Drive& drive) {
  drive.position_after_power_up = config::PositionAfterPowerUp::unknown;
};
inline const auto kOneOfNine = [](Drive& drive) {
  drive.position_after_power_up = config::PositionAfterPowerUp::one_of_several;
  drive.places_per_turn = 9;
};
inline std::function<Planted(const Drive&)> told_home(bool and_then_lost_its_supply = false) {
  return [and_then_lost_its_supply](const Drive& file) {
    Planted planted{make_device(file, milliseconds(100)), {}};
    Frames said;
    planted.device->update({}, MonoTime{1}, milliseconds(1), said);
    config::Joint joint;
    joint.drive = file;
    planted.device->receive(*commissioning::home_frame(joint, 0), MonoTime{1}, said);
    if (and_then_lost_its_supply) planted.device->power_cycle(MonoTime{1});
    return planted;
  };
}

// Damiao's registers, on 7FF and back on the drive's reply id: id, 33 read or 55 write, register, u32.
inline bool is_register(const CanFrame& frame, std::uint8_t op, std::uint8_t number) {
  const bool there = frame.id == 0x7FF || frame.id == 0x13;
  return there && !frame.extended && frame.data[0] == 3 && frame.data[1] == 0 && frame.data[2] == op &&
         frame.data[3] == number;
}
inline std::function<bool(CanFrame&)> register_reads(std::uint8_t number, std::uint32_t value) {
  return [number, value](CanFrame& frame) {
    if (is_register(frame, 0x55, number) && frame.id == 0x7FF) return false;  // no order to it arrives
    if (frame.id == 0x13 && (is_register(frame, 0x33, number) || is_register(frame, 0x55, number)))
      std::memcpy(frame.data + 4, &value, sizeof value);
    return true;
  };
}

// RobStride's parameters: type 17 read, 18 write; index in bytes 0 and 1, value in 4 to 7.
inline bool is_parameter(const CanFrame& frame, std::uint32_t type, std::uint16_t index) {
  return frame.extended && frame.id >> 24 == type && frame.data[0] == (index & 0xFF) && frame.data[1] == index >> 8;
}
inline std::function<bool(CanFrame&)> parameter_reads(std::uint16_t index, std::uint32_t value) {
  return [index, value](CanFrame& frame) {
    if (is_parameter(frame, 18, index)) return false;
    if (is_parameter(frame, 17, index) && (frame.id & 0xFF) == 253) std::memcpy(frame.data + 4, &value, sizeof value);
    return true;
  };
}
// The manual's "reading failed": bits 23 to 16 of the answer's id are not 0.
inline std::function<bool(CanFrame&)> parameter_fails(std::uint16_t index) {
  return [index](CanFrame& frame) {
    if (is_parameter(frame, 17, index) && (frame.id & 0xFF) == 253) frame.id |= 0x1U << 16;
    return true;
  };
}
inline bool ak_v3_firmware(CanFrame& frame) {
  if (frame.id == 0x13) {
    frame.id = 0x2903;
    frame.extended = true;
    frame.length = 8;
  }
  return true;
}

// As the maker's manual of RS00 has it: 8 bytes, the last two its temperature in 0.1 deg C.
inline std::function<bool(CanFrame&)> replies_as_robstride(unsigned tenths) {
  return [tenths](CanFrame& frame) {
    if (frame.id == 0x13) {
      frame.length = 8;
      frame.data[6] = static_cast<std::uint8_t>(tenths >> 8U);
      frame.data[7] = static_cast<std::uint8_t>(tenths & 0xFFU);
    }
    return true;
  };
}
// ODrive's heartbeat (message 01) as firmware 0.5 fills it: its own error numbers, and flags in byte 7.
inline std::function<bool(CanFrame&)> odrive_05(std::uint32_t error) {
  return [error](CanFrame& frame) {
    if ((frame.id & 0x1FU) == 0x01 && !frame.remote) {
      std::memcpy(frame.data, &error, sizeof error);
      frame.data[7] = 0x80;
    }
    return (frame.id & 0x1FU) != 0;  // it tells no version
  };
}

inline const std::vector<Row>& rows() {
  using config::Cia402Mode;
  static const std::vector<Row> all{
      {"damiao, as the file says", damiao(), as_delivered(), ""},
      {"damiao spans another position", damiao(), built([](Drive& d) { d.position_range = 3.14; }),
       "differ from the robot file: position range (register 21)"},
      {"damiao spans another velocity", damiao(), built([](Drive& d) { d.velocity_range = 45; }),
       "differ from the robot file: velocity range (register 22)"},
      {"damiao spans another torque", damiao(), built([](Drive& d) { d.torque_range = 28; }),
       "differ from the robot file: torque range (register 23)"},
      {"damiao in velocity mode", damiao(), saying(register_reads(10, 3)),
       "differ from the robot file: control mode (register 10)"},
      {"damiao whose time-out stays off", damiao(), saying(register_reads(9, 0)), "nothing stops it"},
      {"damiao whose time-out is an hour", damiao(), saying(register_reads(9, 72'000'000)), "longer than 1 s"},
      {"damiao that does not tell its ranges", damiao(),
       saying([](CanFrame& frame) { return !is_register(frame, 0x33, 21); }), "does not tell its settings"},
      {"damiao, the one that the file names", with(damiao(), named("70123", "5013")), as_delivered(), ""},
      {"damiao, another one", with(damiao(), named("70123")), built(named("70124")),
       "differ from the robot file: identity (register 15)"},
      {"damiao with other firmware", with(damiao(), named("any", "5013")), built(named("any", "5012")),
       "differ from the robot file: firmware (register 14)"},
      {"damiao that does not tell its number, and need not", damiao(),
       saying([](CanFrame& frame) { return !is_register(frame, 0x33, 15) && !is_register(frame, 0x33, 13); }), ""},
      {"damiao that does not tell its number", with(damiao(), named("70123")),
       saying([](CanFrame& frame) { return !is_register(frame, 0x33, 15); }),
       "does not tell its settings: identity (register 15)"},
      {"t-motor, waived", tmotor(), as_delivered(), ""},
      {"t-motor without a waiver", with(tmotor(), [](Drive& d) { d.watchdog_waiver = "none"; }), as_delivered(),
       "does not tell its own time-out"},
      {"t-motor with V3 firmware", tmotor(), saying(ak_v3_firmware), "AK V3 firmware"},
      {"robstride in mit protocol, waived", robstride_in_mit(), as_delivered(), ""},
      {"robstride in mit protocol without a waiver",
       with(robstride_in_mit(), [](Drive& d) { d.watchdog_waiver = "none"; }), as_delivered(),
       "does not tell its own time-out"},
      {"robstride in mit protocol, the file says t-motor", tmotor(), saying(replies_as_robstride(250)),
       "RobStride in MIT"},
      {"robstride in mit protocol at 25.9 deg C", tmotor(), saying(replies_as_robstride(259)), "RobStride in MIT"},
      {"robstride in mit protocol, the file says damiao", damiao(),
       saying([](CanFrame& frame) { return !is_register(frame, 0x33, 10); }),
       "control mode (register 10); a RobStride in MIT protocol tells none"},
      {"t-motor without a sensor of temperature", tmotor(), saying(replies_as_robstride(0)), ""},
      {"t-motor that replies with the id that it hears", with(tmotor(), [](Drive& d) { d.reply_id = d.id; }),
       as_delivered(), ""},
      {"robstride, as the file says", robstride(), as_delivered(), ""},
      {"robstride whose time-out stays off", robstride(), saying(parameter_reads(0x7028, 0)), "nothing stops it"},
      {"robstride whose time-out is two seconds", robstride(), saying(parameter_reads(0x7028, 40'000)),
       "longer than 1 s"},
      {"robstride that stays in another run mode", robstride(), saying(parameter_reads(0x7005, 2)),
       "refused its set-up: run mode (parameter 7005)"},
      {"cybergear with its time-out set", robstride("CyberGear"), as_delivered(), ""},
      {"cybergear as delivered", robstride("CyberGear"), as_delivered(Duration{}), "parameter 200C"},
      {"cybergear that cannot tell it", robstride("CyberGear"), saying(parameter_fails(0x200C)),
       "does not tell its own time-out"},
      {"robstride, the one that the file names", with(robstride(), named("00C0FFEE:12345678")), as_delivered(), ""},
      {"robstride, another one", with(robstride(), named("00C0FFEE:12345678")), built(named("00C0FFEE:12345679")),
       "differ from the robot file: identity (unique id, type 0)"},
      {"robstride that does not tell its number, and need not", robstride(),
       saying([](CanFrame& frame) { return frame.id >> 24 != 0; }), ""},
      {"robstride that does not tell its number", with(robstride(), named("00C0FFEE:12345678")),
       saying([](CanFrame& frame) { return frame.id >> 24 != 0; }), "does not tell its settings: identity"},
      {"odrive with the firmware that the file names", with(odrive(), named("any", "0.6.9")), as_delivered(), ""},
      {"odrive with other firmware", with(odrive(), named("any", "0.6.9")), built(named("any", "0.6.8")),
       "differ from the robot file: firmware (message 00)"},
      {"odrive that does not tell its firmware, and need not", odrive(),
       saying([](CanFrame& frame) { return (frame.id & 0x1F) != 0; }), ""},
      {"odrive that does not tell its firmware", with(odrive(), named("any", "0.6.9")),
       saying([](CanFrame& frame) { return (frame.id & 0x1F) != 0; }), "does not tell its settings: firmware"},
      {"odrive with firmware 0.5", odrive(), saying(odrive_05(0)), "firmware 0.5"},
      {"odrive with firmware 0.5, its watchdog expired", odrive(), saying(odrive_05(0x800)), "firmware 0.5"},
      {"odrive that tells a version before 0.6", odrive(), built(named("any", "0.5.6")), "firmware 0.5"},
      {"odrive, waived", odrive(), as_delivered(), ""},
      {"odrive without a waiver", with(odrive(), [](Drive& d) { d.watchdog_waiver = "none"; }), as_delivered(),
       "does not tell its own time-out"},
      {"odrive with an incremental encoder that was not told where it is", with(odrive(), kIncremental), as_delivered(),
       "where the joint is, is not known"},
      {"odrive with an incremental encoder that was told where it is", with(odrive(), kIncremental), told_home(), ""},
      {"odrive that was told where it is and lost its supply", with(odrive(), kIncremental), told_home(true),
       "its drive started, or fell silent and may have lost its supply"},
      {"t-motor with one encoder before the gear", with(tmotor(), kOneOfNine), as_delivered(),
       "where the joint is, is not known"},
      {"moteus, as the file says", moteus(), as_delivered(), ""},
      {"moteus that counts from where it stood", moteus(), moteus_at_home(0), "where the joint is, is not known"},
      {"moteus that knows its rotor alone", moteus(), moteus_at_home(1), "home state (register 00C)"},
      {"moteus, the one that the file names", with(moteus(), named("00110022:00330044:8055F0F1", "0.3.8")),
       as_delivered(), ""},
      {"moteus, another one", with(moteus(), named("00110022:00330044:8055F0F1")),
       built(named("00110022:00330044:8055F0F2")), "differ from the robot file: identity (registers 120 to 122)"},
      {"moteus with other firmware", with(moteus(), named("any", "0.3.8")), built(named("any", "0.3.7")),
       "differ from the robot file: firmware (register 101)"},
      {"moteus that does not tell who it is", with(moteus(), named("any", "0.3.8")),
       saying([](CanFrame& frame) { return frame.id >> 8 != 3 || frame.length <= 48; }),
       "does not tell its settings: firmware"},
      {"moteus that does not tell who it is, and need not", moteus(),
       saying([](CanFrame& frame) { return frame.id >> 8 != 3 || frame.length <= 48; }), ""},
      {"servo, the one that the file names", with(servo(), named("0000009A:00030924:0000CAFE", "00010003")),
       as_delivered(), ""},
      {"servo of another maker", with(servo(), named("0000009A:00030924")), built(named("0000009B:00030924")),
       "differ from the robot file: object 1018:01"},
      {"servo of another model", with(servo(), named("0000009A:00030924")), built(named("0000009A:00030925")),
       "differ from the robot file: object 1018:02"},
      {"servo, another one of its kind", with(servo(), named("0000009A:00030924:00000001")),
       built(named("0000009A:00030924:00000002")), "differ from the robot file: object 1018:04"},
      {"servo with other firmware", with(servo(), named("any", "00010003")), built(named("any", "00010002")),
       "differ from the robot file: object 1018:03"},
      {"servo that tells its maker alone, and need not more", servo(), servo_with({.identity_entries = 1}), ""},
      {"servo that tells its maker alone", with(servo(), named("00000054:04020001")),
       servo_with({.identity_entries = 1}), "does not tell its settings: object 1018:02, abort 06090011"},
      {"servo, as the file says", servo(), as_delivered(), ""},
      {"servo of another size", servo(), built([](Drive& d) { d.rated_torque = 11; }), "object 6076:00"},
      {"servo in rpm, the file says counts", servo(Cia402Mode::csv),
       servo_with({.speed_counts = 60, .velocity_unit = 0x00B4'4700}), "object 60A9:00"},
      {"servo in rpm, as the file says",
       with(servo(Cia402Mode::csv), [](Drive& d) { d.velocity_unit = config::Cia402VelocityUnit::rpm; }),
       as_delivered(), ""},
      {"servo without torque mode", servo(), servo_with({.modes = 0x180}), "object 6502:00"},
      {"servo whose mode does not change", servo(), servo_with({.shows_mode = false}), "object 6061:00"},
      {"servo without a watchdog", servo(), servo_with({.has_deadline = false, .has_heartbeat_watch = false}),
       "object 1016:01, abort 06020000, no such object"},
      {"servo with a mapping of its own", servo(), servo_with({.map = Cia402Profile::Map::fixed_words_only}),
       "object 1600:00, abort 06010002, can only be read"},
      {"servo without a torque limit, in CSP", servo(Cia402Mode::csp), servo_with({.has_max_torque = false}),
       "object 6072:00, abort 06020000, no such object"},
      {"servo that ignores its target", servo(), servo_with({.follows = false}), "statusword bit 12"},
  };
  return all;
}

}  // namespace takt::simulation::misconfigured
