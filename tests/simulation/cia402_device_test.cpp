// SPDX-License-Identifier: Apache-2.0
// Goal: the simulated drive keeps the device side of CANopen and CiA 402: bytes, states, refusals, watchdog.
// Method: frames written out by hand from the standards' tables; the host's codec is not used here.
#include "simulation/cia402_device.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "simulation/device_table.hpp"
#include "tests/drivers/protocol/cia402/cia402_frames.hpp"

namespace takt::simulation {
namespace {

using drivers::CanFrame;
using drivers::test::frame;
using drivers::test::text;

config::Drive node5() {
  config::Drive drive;
  drive.protocol = config::DriveProtocol::cia402;
  drive.id = 5;
  drive.counts_per_turn = 4096;
  drive.rated_torque = 10;
  drive.torque_range = 3;
  return drive;
}

class SimulatedServo : public testing::Test {
 protected:
  std::vector<std::string> hear(const CanFrame& one) {
    Frames answers;
    drive.receive(one, now, answers);
    std::vector<std::string> texts;
    for (const CanFrame& answer : answers) texts.push_back(text(answer));
    return texts;
  }
  // The one answer; empty: none.
  std::string answer(const CanFrame& one) {
    const auto texts = hear(one);
    EXPECT_LE(texts.size(), 1U);
    return texts.empty() ? "" : texts.front();
  }
  std::string write(std::uint32_t bytes, std::uint32_t index, std::uint32_t sub, std::uint32_t value) {
    return answer(frame(0x605, {0x23 | (4 - bytes) << 2, index & 0xFF, index >> 8, sub, value & 0xFF, value >> 8 & 0xFF,
                                value >> 16 & 0xFF, value >> 24}));
  }
  std::string read(std::uint32_t index, std::uint32_t sub = 0) {
    return answer(frame(0x605, {0x40, index & 0xFF, index >> 8, sub, 0, 0, 0, 0}));
  }
  bool takes(std::uint32_t bytes, std::uint32_t index, std::uint32_t sub, std::uint32_t value) {
    return write(bytes, index, sub, value).substr(4, 2) == "60";
  }
  void nmt(std::uint32_t command, std::uint32_t node = 5) { hear(frame(0, {command, node})); }
  double update(double position = 0, double velocity = 0) {
    now = now + milliseconds(1);
    return drive.update({position, velocity}, now, milliseconds(1), said);
  }
  std::vector<std::string> said_texts() {
    std::vector<std::string> texts;
    for (const CanFrame& one : said) texts.push_back(text(one));
    said.clear();
    return texts;
  }
  std::string last_said() {
    const auto texts = said_texts();
    return texts.empty() ? "" : texts.back();
  }
  // Torque, position or velocity mode, by SDO, in the order that a drive accepts.
  void configure(std::uint32_t target = 0x60710010, std::uint32_t mode = 10) {
    EXPECT_TRUE(takes(4, 0x1400, 1, 0x80000205));
    EXPECT_TRUE(takes(1, 0x1600, 0, 0));
    EXPECT_TRUE(takes(4, 0x1600, 1, 0x60400010));
    EXPECT_TRUE(takes(4, 0x1600, 2, 0x60600008));
    EXPECT_TRUE(takes(4, 0x1600, 3, target));
    EXPECT_TRUE(takes(1, 0x1600, 0, 3));
    EXPECT_TRUE(takes(1, 0x1400, 2, 1));
    EXPECT_TRUE(takes(2, 0x1400, 5, 50));
    EXPECT_TRUE(takes(4, 0x1400, 1, 0x205));
    EXPECT_TRUE(takes(4, 0x1800, 1, 0xC0000185));
    EXPECT_TRUE(takes(1, 0x1A00, 0, 0));
    EXPECT_TRUE(takes(4, 0x1A00, 1, 0x60410010));
    EXPECT_TRUE(takes(4, 0x1A00, 2, 0x60640020));
    EXPECT_TRUE(takes(4, 0x1A00, 3, 0x60770010));
    EXPECT_TRUE(takes(1, 0x1A00, 0, 3));
    EXPECT_TRUE(takes(1, 0x1800, 2, 1));
    EXPECT_TRUE(takes(4, 0x1800, 1, 0x40000185));
    EXPECT_TRUE(takes(1, 0x6060, 0, mode));
    nmt(1);
  }
  // One cycle: RPDO with a 16-bit target, SYNC; the statusword of the TPDO that comes back.
  std::string cycle(std::uint32_t controlword, std::uint32_t torque = 0) {
    EXPECT_TRUE(hear(frame(0x205, {controlword, 0, 10, torque & 0xFF, torque >> 8 & 0xFF})).empty());
    const auto texts = hear(frame(0x080, {}));
    EXPECT_FALSE(texts.empty());
    return texts.empty() ? "" : texts.front().substr(4, 4);
  }
  void enable() {
    configure();
    for (const std::uint32_t controlword : {0x06U, 0x07U, 0x0FU}) cycle(controlword);
    ASSERT_EQ(drive.state(), DeviceState::enabled);
  }
  Frames said;
  MonoTime now{1};
  Cia402Device drive{node5(), milliseconds(100)};
};

// 6065 and 6066: 100 counts for 5 ms. A motor that is held away from its target faults; one that is back in time does
// not, nor one whose drive was never told a window.
TEST_F(SimulatedServo, InPositionModeItWatchesItsFollowingError) {
  constexpr double kBeyond = 0.2;  // rad, 130 counts
  for (const bool watches : {false, true}) {
    drive.power_cycle(now);
    now = now + seconds(2);
    update();
    configure(0x607A0020, 8);
    if (watches) {
      EXPECT_TRUE(takes(4, 0x6065, 0, 100));
      EXPECT_TRUE(takes(2, 0x6066, 0, 5));
    }
    const auto command = [&](std::uint32_t controlword) {
      hear(frame(0x205, {controlword, 0, 8, 0, 0, 0, 0}));
      hear(frame(0x080, {}));
    };
    for (const std::uint32_t controlword : {0x06U, 0x07U, 0x0FU}) command(controlword);
    ASSERT_EQ(drive.state(), DeviceState::enabled);
    for (int i = 0; i < 4; ++i) command(0x0F), update(kBeyond);
    command(0x0F), update(0);
    for (int i = 0; i < 5; ++i) command(0x0F), update(kBeyond);
    EXPECT_EQ(drive.state(), DeviceState::enabled) << "within its time";
    for (int i = 0; i < 2; ++i) command(0x0F), update(kBeyond);
    EXPECT_EQ(drive.state() == DeviceState::enabled, !watches);
    EXPECT_EQ(drive.objects().value(0x603F) == 0x8611, watches);
  }
}

TEST_F(SimulatedServo, AnswersReadsWithTheObjectsSize) {
  EXPECT_EQ(read(0x1000), "585#4300100092010200");
  EXPECT_EQ(read(0x6076), "585#4376600010270000") << "10000 mNm";
  EXPECT_EQ(read(0x6041), "585#4b41600050020000") << "switch-on disabled";
  EXPECT_EQ(read(0x6061), "585#4f61600000000000");
  EXPECT_EQ(read(0x1400, 5), "585#4b00140564000000") << "the stored deadline: 100 ms";
}

TEST_F(SimulatedServo, RefusesWithTheRightAbortCode) {
  struct Row {
    const char* when;
    std::uint32_t bytes, index, sub, value;
    const char* code;  // little-endian
  };
  const Row rows[] = {
      {"no such object", 1, 0x6008, 0, 1, "00000206"},
      {"no such sub-index", 1, 0x60C2, 7, 1, "11000906"},
      {"read only", 4, 0x6076, 0, 1, "02000106"},
      {"wrong size", 2, 0x6060, 0, 10, "10000706"},
      {"no such mode", 1, 0x6060, 0, 3, "30000906"},
      {"period of zero", 1, 0x60C2, 1, 0, "30000906"},
      {"map of a PDO that exists", 1, 0x1600, 0, 0, "00000106"},
      {"TPDO open to remote frames", 4, 0x1800, 1, 0x80000185, "30000906"},
      {"29-bit id", 4, 0x1400, 1, 0xA0000205, "30000906"},
      {"another id while the PDO exists", 4, 0x1400, 1, 0x206, "30000906"},
      {"reserved transmission type", 1, 0x1400, 2, 245, "30000906"},
  };
  for (const Row& row : rows) {
    const std::string answered = write(row.bytes, row.index, row.sub, row.value);
    EXPECT_EQ(answered.substr(0, 6), "585#80") << row.when;
    EXPECT_EQ(answered.substr(12), row.code) << row.when;
  }
  EXPECT_EQ(read(0x5FFF), "585#80ff5f0000000206");
  EXPECT_EQ(answer(frame(0x605, {0x21, 0x60, 0x60, 0, 8, 0, 0, 0})), "585#8060600001000405") << "segmented";
}

TEST_F(SimulatedServo, MapsAreCheckedEntryByEntry) {
  EXPECT_TRUE(takes(4, 0x1400, 1, 0x80000205));
  EXPECT_EQ(write(4, 0x1600, 1, 0x60400010).substr(12), "00000106") << "the map still counts entries";
  EXPECT_TRUE(takes(1, 0x1600, 0, 0));
  EXPECT_EQ(write(4, 0x1600, 1, 0x60410010).substr(12), "41000406") << "a statusword is not for writing";
  EXPECT_EQ(write(4, 0x1600, 1, 0x60400020).substr(12), "41000406") << "nor has it 32 bits";
  EXPECT_EQ(write(4, 0x1600, 1, 0x60760020).substr(12), "41000406");
  EXPECT_TRUE(takes(4, 0x1600, 1, 0x607A0020));
  EXPECT_TRUE(takes(4, 0x1600, 2, 0x60FF0020));
  EXPECT_TRUE(takes(4, 0x1600, 3, 0x60400010));
  EXPECT_EQ(write(1, 0x1600, 0, 3).substr(12), "42000406") << "ten bytes";
  EXPECT_EQ(write(1, 0x1600, 0, 4).substr(12), "41000406") << "an empty entry";
  EXPECT_EQ(write(1, 0x1600, 0, 5).substr(12), "30000906");
  EXPECT_TRUE(takes(1, 0x1600, 0, 2));
}

TEST_F(SimulatedServo, PdosAreConfiguredBeforeOperationOnly) {
  configure();
  EXPECT_EQ(write(4, 0x1400, 1, 0x80000205).substr(12), "22000008");
  EXPECT_TRUE(takes(2, 0x1017, 0, 10)) << "the rest goes on";
  nmt(128);
  EXPECT_TRUE(takes(4, 0x1400, 1, 0x80000205));
}

TEST_F(SimulatedServo, PdosFlowInOperationalOnlyAndWithTheSync) {
  EXPECT_TRUE(hear(frame(0x080, {})).empty());
  configure();
  update(std::numbers::pi, 0);
  EXPECT_TRUE(hear(frame(0x205, {0x06, 0, 10, 0, 0})).empty());
  EXPECT_EQ(answer(frame(0x080, {})), "185#5002000800000000") << "2048 counts, and the state before this command";
  EXPECT_EQ(answer(frame(0x080, {})).substr(0, 8), "185#3102");
  nmt(2, 0);
  EXPECT_TRUE(hear(frame(0x080, {})).empty()) << "stopped, with everybody else";
  EXPECT_EQ(read(0x1000), "") << "no SDO either";
  nmt(1, 4);
  EXPECT_TRUE(hear(frame(0x080, {})).empty()) << "somebody else was started";
}

TEST_F(SimulatedServo, TheMapThatWasWrittenIsTheOneObeyed) {
  configure();
  nmt(128);
  // Mode and target change places.
  EXPECT_TRUE(takes(4, 0x1400, 1, 0x80000205));
  EXPECT_TRUE(takes(1, 0x1600, 0, 0));
  EXPECT_TRUE(takes(4, 0x1600, 2, 0x60710010));
  EXPECT_TRUE(takes(4, 0x1600, 3, 0x60600008));
  EXPECT_TRUE(takes(1, 0x1600, 0, 3));
  EXPECT_TRUE(takes(4, 0x1400, 1, 0x305)) << "and another id, now that the PDO was off";
  nmt(1);
  hear(frame(0x205, {0x06, 0, 9, 9, 9}));
  hear(frame(0x305, {0x06, 0, 0x83, 0xFF, 9}));
  hear(frame(0x080, {}));
  EXPECT_EQ(read(0x6071), "585#4b71600083ff0000");
  EXPECT_EQ(read(0x6061), "585#4f61600009000000");
}

TEST_F(SimulatedServo, StateMachineBothWays) {
  configure();
  struct Step {
    std::uint32_t controlword;
    const char* before;  // the statusword that the same SYNC brings back, little-endian
  };
  const Step steps[] = {
      {0x0F, "5002"}, {0x07, "5002"}, {0x06, "5002"},  // only shutdown leads out of switch-on disabled
      {0x06, "3102"}, {0x07, "3102"}, {0x0F, "3302"}, {0x0F, "3712"}, {0x07, "3712"}, {0x06, "3302"},
      {0x0F, "3102"}, {0x0F, "3302"}, {0x06, "3712"}, {0x00, "3102"}, {0x06, "5002"}, {0x07, "3102"},
      {0x0F, "3302"}, {0x02, "3712"}, {0x0F, "1702"}, {0x00, "1702"}, {0x00, "5002"},
  };
  int index = 0;
  for (const Step& step : steps) EXPECT_EQ(cycle(step.controlword), step.before) << index++;
}

TEST_F(SimulatedServo, TorqueIsPerMilleOfRatedWhenEnabledOnly) {
  configure();
  cycle(0x06, 100);
  EXPECT_EQ(update(), 0);
  EXPECT_TRUE(drive.brake_engaged());
  cycle(0x07, 100);
  cycle(0x0F, 0xFF83);  // -125 per mille of 10 Nm
  EXPECT_DOUBLE_EQ(update(), -1.25);
  EXPECT_FALSE(drive.brake_engaged());
  cycle(0x0F, 1000);
  EXPECT_EQ(update(), 3) << "the motor's own limit";
  cycle(0x0F, 0);
  EXPECT_EQ(answer(frame(0x080, {})), "185#371a000000002c01") << "300 per mille were flowing, the most";
}

TEST_F(SimulatedServo, ShortRpdosAreReportedAndNotObeyed) {
  enable();
  hear(frame(0x205, {0x0F, 0, 10, 50}));
  update();
  EXPECT_EQ(last_said(), "085#1082110000000000");
  EXPECT_EQ(drive.state(), DeviceState::error);
}

TEST_F(SimulatedServo, TheDeadlineOfCommandsIsTheOneWritten) {
  enable();
  for (int ms = 0; ms < 50; ++ms) {
    update();
    hear(frame(0x080, {}));  // SYNC alone is no command
  }
  EXPECT_EQ(drive.state(), DeviceState::enabled) << "exactly at the limit";
  update();
  EXPECT_EQ(drive.state(), DeviceState::lost);
  EXPECT_EQ(last_said(), "085#5082110000000000");
  EXPECT_LT(update(0, 2), 0) << "brakes";
  EXPECT_EQ(cycle(0x0F), "1802") << "fault";
  EXPECT_EQ(drive.state(), DeviceState::lost) << "commands do not bring it back";
  EXPECT_TRUE(hear(frame(0x205, {0x80, 0, 10, 0, 0})).empty());
  const auto texts = hear(frame(0x080, {}));
  ASSERT_EQ(texts.size(), 2U);
  EXPECT_EQ(texts[1], "085#0000000000000000") << "reset: no error any more";
  EXPECT_EQ(drive.state(), DeviceState::disabled);
}

TEST_F(SimulatedServo, AFaultResetNeedsARisingEdge) {
  enable();
  cycle(0x8F);
  drive.inject(DeviceFault::over_current);
  update();
  EXPECT_EQ(last_said(), "085#1023030000000000");
  update();
  cycle(0x80);
  EXPECT_EQ(cycle(0x80), "1802") << "held, not risen";
  cycle(0x00);
  cycle(0x80);
  EXPECT_EQ(cycle(0x00), "5002");
}

TEST_F(SimulatedServo, EveryFaultHasItsEmergency) {
  struct Row {
    DeviceFault fault;
    const char* emergency;
  };
  for (const Row& row :
       {Row{DeviceFault::over_temperature, "085#1043090000000000"},
        Row{DeviceFault::over_current, "085#1023030000000000"}, Row{DeviceFault::over_voltage, "085#1031050000000000"},
        Row{DeviceFault::under_voltage, "085#2031050000000000"}, Row{DeviceFault::encoder, "085#0573210000000000"},
        Row{DeviceFault::overload, "085#5023030000000000"}}) {
    EXPECT_TRUE(drive.inject(row.fault));
    update();
    EXPECT_EQ(said_texts(), std::vector<std::string>{row.emergency});
    EXPECT_EQ(drive.state(), DeviceState::error);
    EXPECT_TRUE(drive.brake_engaged());
  }
}

TEST_F(SimulatedServo, LeavingOperationalWhileEnabledStopsTheDrive) {
  enable();
  nmt(128);
  EXPECT_EQ(drive.state(), DeviceState::lost);
  update();
  EXPECT_EQ(said_texts(), std::vector<std::string>{"085#0081110000000000"});
}

TEST_F(SimulatedServo, HeartbeatsTellTheNmtState) {
  EXPECT_TRUE(takes(2, 0x1017, 0, 10));
  const auto heard = [this] {
    said.clear();
    for (int ms = 0; ms < 30; ++ms) update();
    return said_texts();
  };
  EXPECT_EQ(heard(), (std::vector<std::string>(3, "705#7f")));
  nmt(1);
  EXPECT_EQ(heard(), (std::vector<std::string>(3, "705#05")));
  nmt(2);
  EXPECT_EQ(heard(), (std::vector<std::string>(3, "705#04")));
}

TEST_F(SimulatedServo, APowerCycleForgetsEverythingAndEndsWithABootMessage) {
  enable();
  drive.power_cycle(now);
  EXPECT_TRUE(drive.brake_engaged());
  EXPECT_EQ(read(0x1000), "") << "booting";
  for (Duration waited; waited < kBootTime; waited = waited + milliseconds(1)) update();
  EXPECT_EQ(said_texts(), std::vector<std::string>{"705#00"});
  EXPECT_EQ(read(0x1600, 0), "585#4f00160001000000") << "the default map";
  EXPECT_EQ(drive.state(), DeviceState::disabled);
}

TEST_F(SimulatedServo, ACommunicationResetKeepsTheDrivesOwnSettings) {
  configure();
  nmt(130);
  for (Duration waited; waited < kBootTime; waited = waited + milliseconds(1)) update();
  EXPECT_EQ(said_texts(), std::vector<std::string>{"705#00"});
  EXPECT_EQ(read(0x1600, 0), "585#4f00160001000000");
  EXPECT_EQ(read(0x6060), "585#4f6060000a000000");
}

// Goal: the drive's own loops bring the motor where they are told. Method: a free mass of 0.05 kg m^2 on the shaft.
class SimulatedServoLoops : public SimulatedServo {
 protected:
  void run(std::uint32_t target, std::uint32_t mode) {
    configure(mode == 8 ? 0x607A0020 : 0x60FF0020, mode);
    for (int ms = 0; ms < 3000; ++ms) {
      const std::uint32_t controlword = ms == 0 ? 0x06U : ms == 1 ? 0x07U : 0x0FU;
      hear(frame(0x205, {controlword, 0, mode, target & 0xFF, target >> 8 & 0xFF, target >> 16 & 0xFF, target >> 24}));
      hear(frame(0x080, {}));
      velocity += update(position, velocity) / 0.05 * 1e-3;
      position += velocity * 1e-3;
    }
  }
  double position = 0, velocity = 0;
};

TEST_F(SimulatedServoLoops, Position) {
  run(static_cast<std::uint32_t>(-1024), 8);
  EXPECT_NEAR(position, -std::numbers::pi / 2, 0.01);
  EXPECT_NEAR(velocity, 0, 0.01);
}

TEST_F(SimulatedServoLoops, Velocity) {
  run(2048, 9);
  EXPECT_NEAR(velocity, std::numbers::pi, 0.01);
}

TEST_F(SimulatedServo, FramesThatAreNotForItAreNotAnswered) {
  EXPECT_TRUE(hear(frame(0x606, {0x40, 0, 0x10, 0, 0, 0, 0, 0})).empty());
  EXPECT_TRUE(hear(frame(0x605, {0x40, 0, 0x10, 0})).empty());
  for (int kind = 0; kind < 4; ++kind) {
    CanFrame odd = frame(0x605, {0x40, 0, 0x10, 0, 0, 0, 0, 0});
    odd.extended = kind == 0;
    odd.fd = kind == 1;
    odd.remote = kind == 2;
    odd.error = kind == 3;
    EXPECT_TRUE(hear(odd).empty()) << kind;
  }
  EXPECT_TRUE(hear(frame(0x000, {1})).empty());
  EXPECT_TRUE(hear(frame(0x080, {})).empty()) << "not started by half a frame";
}

TEST(DeviceTable, PlaysCia402) {
  const auto device = make_device(node5(), milliseconds(100));
  ASSERT_TRUE(device);
  EXPECT_EQ(device->state(), DeviceState::disabled);
}

}  // namespace
}  // namespace takt::simulation
