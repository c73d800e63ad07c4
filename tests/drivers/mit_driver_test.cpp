// Goal: the driver enables, drives and disables as its header promises, in joint units.
// Method: the drive's replies are written by hand, byte for byte, and the frames that come out are read.
#include "drivers/mit_driver.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace takt::drivers {
namespace {

const MitRange kDm4310{12.5F, 30, 500, 5, 10};

class Bench {
 public:
  explicit Bench(MitDriveSettings settings) : driver(settings), settings_(settings) {}

  CanFrame encode(bool enable, const DriveSetpoint& setpoint = {}) {
    std::array<CanFrame, 2> out;
    EXPECT_EQ(driver.encode(enable, setpoint, milliseconds(10), out), 1U);
    EXPECT_EQ(out[0].id, settings_.id);
    EXPECT_EQ(out[0].length, 8);
    return out[0];
  }
  int code_after_seven_ff(bool enable) {
    const CanFrame frame = encode(enable);
    for (int i = 0; i < 7; ++i)
      if (frame.data[i] != 0xFF) return -1;
    return frame.data[7];
  }
  // Position 0x8000, velocity and torque in the middle.
  bool reply(int first_byte, int length = 8) {
    ReceivedFrame received;
    received.received_at = MonoTime{++stamp_};
    received.frame.id = settings_.reply_id;
    received.frame.length = static_cast<std::uint8_t>(length);
    const std::array<int, 8> bytes{first_byte, 0x80, 0x00, 0x80, 0x08, 0x00, 30, 40};
    for (std::size_t i = 0; i < bytes.size(); ++i) received.frame.data[i] = static_cast<std::uint8_t>(bytes[i]);
    return driver.decode(received);
  }

  MitDriver driver;

 private:
  MitDriveSettings settings_;
  std::int64_t stamp_ = 100;
};

MitDriveSettings damiao() {
  return {.range = kDm4310, .variant = MitVariant::damiao, .id = 4, .reply_id = 0x14, .mapping = {}};
}
MitDriveSettings tmotor() {
  return {.range = kDm4310, .variant = MitVariant::tmotor, .id = 4, .reply_id = 0x14, .mapping = {}};
}

constexpr int kDisabled = 0x04, kEnabled = 0x14, kLost = 0xD4;

TEST(MitDriver, KnowsNothingBeforeTheFirstReply) {
  Bench bench(damiao());
  EXPECT_FALSE(bench.driver.feedback().received_at.is_set());
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::unknown);
}

TEST(MitDriver, DamiaoIsEnabledByItsOwnWord) {
  Bench bench(damiao());
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFD);
  EXPECT_TRUE(bench.reply(kDisabled));
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC);
  EXPECT_TRUE(bench.reply(kDisabled)) << "sent before the drive read the command";
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC) << "not before the drive says so";
  EXPECT_TRUE(bench.reply(kEnabled));
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::enabled);
  EXPECT_EQ(bench.code_after_seven_ff(true), -1) << "now motion commands";
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFD);
}

TEST(MitDriver, TMotorIsEnabledByTheFirstReplyAfterTheRequest) {
  Bench bench(tmotor());
  EXPECT_TRUE(bench.reply(4, 6));
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::unknown);
  bench.encode(false);
  EXPECT_TRUE(bench.reply(4, 6));
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC);
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC) << "no reply, not enabled";
  EXPECT_TRUE(bench.reply(4, 6));
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::enabled);
  EXPECT_EQ(bench.code_after_seven_ff(true), -1);
}

TEST(MitDriver, DoesNotBringBackADriveThatLeftByItself) {
  Bench bench(damiao());
  bench.encode(true);
  bench.reply(kEnabled);
  bench.encode(true);
  for (const int state : {kDisabled, kLost}) {
    bench.reply(state);
    EXPECT_EQ(bench.code_after_seven_ff(true), -1) << state;
  }
  bench.encode(false);
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC) << "after a disable in between it may";
}

TEST(MitDriver, ReportsAndClearsADamiaoErrorWhileDisabled) {
  Bench bench(damiao());
  bench.reply(kLost);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault);
  EXPECT_EQ(bench.driver.feedback().error_code, 0xDU);
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFB);
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFD);
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFB);
  bench.reply(kDisabled);
  EXPECT_EQ(bench.driver.feedback().error_code, 0U);
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFD);
}

TEST(MitDriver, IgnoresWhatIsNotItsOwnAndCountsWhatIsMalformed) {
  Bench bench(damiao());
  EXPECT_FALSE(bench.reply(0x15)) << "another drive behind the same master id";
  EXPECT_EQ(bench.driver.malformed_frames(), 0U);
  EXPECT_FALSE(bench.reply(kEnabled, 6));
  EXPECT_FALSE(bench.reply(kEnabled, 0));
  EXPECT_EQ(bench.driver.malformed_frames(), 2U);
  ReceivedFrame foreign;
  foreign.frame.id = 0x13;
  foreign.frame.length = 8;
  EXPECT_FALSE(bench.driver.decode(foreign));
  EXPECT_FALSE(bench.driver.feedback().received_at.is_set());
}

TEST(MitDriver, StampsAndTemperatureOfTheNewestReply) {
  Bench bench(damiao());
  bench.reply(kDisabled);
  bench.reply(kDisabled);
  EXPECT_EQ(bench.driver.feedback().received_at.ns, 102);
  EXPECT_EQ(bench.driver.feedback().temperature_C, 40);
}

// Goal: direction, offset and gear are applied once, both ways, gains squared.
TEST(MitDriver, ConvertsBetweenJointAndMotor) {
  MitDriveSettings settings = damiao();
  settings.mapping.offset = 0.5F;
  settings.mapping.ratio = -2;
  Bench bench(settings);
  bench.encode(true);
  bench.reply(kEnabled);
  const CanFrame frame = bench.encode(true, {.q = 1.5F, .dq = 2, .kp = 40, .kd = 4, .tau = 3});
  // Motor side: p = (1.5 - 0.5) * -2 = -2 rad, v = -4 rad/s, kp = 40 / 4, kd = 4 / 4, t = 3 / -2.
  const MitPayload expected = encode_mit_command(kDm4310, {.p = -2, .v = -4, .kp = 10, .kd = 1, .t = -1.5F});
  for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(frame.data[i], expected[i]) << i;

  // Motor 0x8000 is +0.19 mrad: almost at zero, hence the joint almost at its offset.
  EXPECT_NEAR(bench.driver.feedback().q, 0.5, 4e-4);
  ReceivedFrame received;
  received.frame.id = 0x14;
  received.frame.length = 8;
  // Position code 0xC000 is 12.5 * (2 * 49152 / 65535 - 1) = 6.2502 rad; velocity and torque codes
  // 0xC00: 15.005, 5.0012.
  const std::uint8_t bytes[8]{0x14, 0xC0, 0x00, 0xC0, 0x0C, 0x00, 0, 0};
  std::copy_n(bytes, 8, received.frame.data);
  EXPECT_TRUE(bench.driver.decode(received));
  EXPECT_NEAR(bench.driver.feedback().q, 6.2502 / -2 + 0.5, 1e-3);
  EXPECT_NEAR(bench.driver.feedback().dq, 15.005 / -2, 1e-2);
  EXPECT_NEAR(bench.driver.feedback().tau, 5.0012 * -2, 1e-2);
}

}  // namespace
}  // namespace takt::drivers
