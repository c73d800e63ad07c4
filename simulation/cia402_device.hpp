// SPDX-License-Identifier: Apache-2.0
// A CANopen servo drive (CiA 301, CiA 402) with the cyclic synchronous modes position, velocity and torque.
//
// NMT state      entered by                                                does
// booting        power_cycle(), NMT reset; for kBootTime                   nothing, then its boot message (heartbeat 0)
// pre-operational  end of boot, NMT 128                                    SDO, heartbeat, EMCY
// operational    NMT 1                                                     PDOs as they were configured, besides
// stopped        NMT 2                                                     heartbeat
// Starts pre-operational. PDOs: synchronous RPDOs (type 0..240) are taken over at the next SYNC, others at once; a
// TPDO of type 1..240 is sent at every SYNC, whatever the number, and tells the drive's state before the RPDOs of that
// SYNC; event-driven TPDOs are not simulated. Watchdog: the event timer of RPDO 1 (1400:05), from the first RPDO after
// NMT start, while operation is enabled; out of time is EMCY 8250 and DeviceState::lost. So is leaving NMT state
// operational with operation enabled (EMCY 8100). A fault reset clears lost ones and errors alike. Besides, where
// 1016:01 names a node: its heartbeat, from the first one on; out of time is EMCY 8130 and lost as well, unless 6007 is
// 0. `watchdog` is what the drive has stored in 1400:05 before the host writes its own. Max torque (6072) holds the
// torque down, and shows in statusword bit 11. One whose position_after_power_up is unknown counts from where it was
// switched on. In position mode a motor further from its target than 6065, for 6066,
// faults (8611). What drives differ in: cia402_profile.hpp.
#pragma once

#include <optional>

#include "simulation/cia402_objects.hpp"
#include "simulation/cia402_power.hpp"
#include "simulation/device.hpp"

namespace takt::simulation {

class Cia402Device final : public Device {
 public:
  Cia402Device(const config::Drive& drive, Duration watchdog);
  Cia402Device(const config::Drive& drive, Duration watchdog, const Cia402Profile& profile);

  void receive(const drivers::CanFrame& frame, MonoTime now, Frames& out) override;
  double update(MotorReading reading, MonoTime now, Duration step, Frames& out) override;
  [[nodiscard]] DeviceState state() const override;
  bool inject(DeviceFault fault) override;
  void power_cycle(MonoTime now) override;
  [[nodiscard]] const Cia402Objects& objects() const { return objects_; }

 private:
  enum class Nmt : std::uint8_t { booting, pre_operational, operational, stopped };
  void obey_nmt(const drivers::CanFrame& frame, MonoTime now);
  void serve_sdo(const drivers::CanFrame& frame, Frames& out);
  [[nodiscard]] drivers::CanFrame start_text(std::uint8_t sub);
  [[nodiscard]] drivers::CanFrame next_segment(std::uint8_t command);
  [[nodiscard]] drivers::CanFrame sdo_answer(std::uint8_t command, std::uint16_t index, std::uint8_t sub,
                                             std::uint32_t value) const;
  void take_rpdo(const drivers::CanFrame& frame, MonoTime now, Frames& out);
  void take_over(const drivers::CanFrame& rpdo, Frames& out);
  void synchronise(Frames& out);
  void leave_operational(Nmt next);
  void trip(std::uint16_t code, std::uint8_t error_register, bool lost);
  void note_error(std::uint16_t code, std::uint8_t error_register);
  void say_emergencies(Frames& out);
  void say_heartbeat(MonoTime now, Frames& out);
  void watch_commands(MonoTime now);
  void hear_heartbeat(const drivers::CanFrame& frame, MonoTime now);
  void watch_heartbeat(MonoTime now);
  void watch_following(MonoTime now);
  void show_mode();
  [[nodiscard]] double most_torque() const;
  void refresh_objects();
  [[nodiscard]] drivers::CanFrame heartbeat(std::uint8_t state) const;
  [[nodiscard]] double wanted_torque(Duration step);
  [[nodiscard]] double torque_for_velocity(double velocity, Duration step);

  config::Drive drive_;
  Cia402Profile profile_;
  Cia402Objects objects_;
  Cia402Power power_;
  Nmt nmt_ = Nmt::pre_operational;
  std::optional<std::size_t> segments_;  // of the text that is being fetched, so far
  bool lost_ = false;
  std::optional<drivers::CanFrame> pending_rpdo_;
  std::optional<MonoTime> commanded_at_;   // since NMT start
  std::optional<MonoTime> host_heard_at_;  // its heartbeat
  std::optional<MonoTime> behind_since_;   // further from its target than 6065
  bool limited_ = false;                   // by 6072
  MonoTime booted_at_, heartbeat_at_;
  Frames emergencies_;            // not sent yet
  std::optional<double> origin_;  // rad, what it counts from; unset: since power-on it has not looked
  MotorReading reading_;          // from there
  double torque_ = 0;
  double velocity_integral_ = 0;  // Nm
};

}  // namespace takt::simulation
