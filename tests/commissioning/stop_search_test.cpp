// SPDX-License-Identifier: Apache-2.0
// Goal: a joint is led to its stop with no more torque than told, and where it came to stand is known; anything odd
// ends with the drive disabled and a reason. Method: host driver and simulated drive on an inertia with a wall, in
// virtual time; of a drive that takes a torque, one that closes its own loop, and one that must not be enabled
// otherwise.
#include "commissioning/stop_search.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "drivers/protocol/protocol_table.hpp"
#include "simulation/device_table.hpp"
#include "tests/simulation/plant_robots.hpp"

namespace takt::commissioning {
namespace {

constexpr StopWish kWish{.direction = 1, .speed = 0.3, .torque = 1, .within = 1.5};

class Search : public testing::Test {
 protected:
  Search() { use(robot_.joints[3].drive); }
  void use(const config::Drive& drive) {
    robot_.joints[3].drive = drive;
    driver_ = drivers::make_joint_driver(robot_, 3).value();
    device_ = simulation::make_device(drive, milliseconds(100));
    simulation::Frames said;
    device_->update({gear_ * q_, gear_ * dq_}, now_, {}, said);
  }
  void run(const StopWish& wish) {
    StopSearch search(robot_.joints[3], wish, *driver_);
    for (int ms = 0; ms < 40'000 && !search.ended(); ++ms) step(search);
    EXPECT_TRUE(search.ended());
    failure_ = search.failure();
    stop_at_ = search.stop_at();
    EXPECT_NE(device_->state(), simulation::DeviceState::enabled);
  }
  void step(StopSearch& search) {
    now_ = now_ + milliseconds(1);
    std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out;
    simulation::Frames answers;
    const std::size_t sent = search.tick(now_, out);
    for (std::size_t i = 0; i < sent && is_there_; ++i) device_->receive(out[i], now_, answers);
    const double motor = gear_ * device_->update({gear_ * q_, gear_ * dq_}, now_, milliseconds(1), answers);
    const double torque = is_wired_backwards_ ? -motor : motor;
    most_torque_ = std::max(most_torque_, std::abs(torque + double{robot_.joints[3].kd} * dq_));
    dq_ += 0.001 * (torque + load_ - viscous_ * dq_) / inertia_;
    q_ += 0.001 * dq_;
    if (q_ > wall_) {
      q_ = wall_;
      dq_ = std::min(dq_, 0.0);
    }
    if (is_there_)
      for (const drivers::CanFrame& answer : answers) driver_->decode({answer, now_});
    if (fault_at_ && q_ > *fault_at_) {
      device_->inject(simulation::DeviceFault::over_current);
      fault_at_.reset();
    }
  }

  config::RobotConfig robot_ = test::demo_arm();
  std::unique_ptr<drivers::JointDriver> driver_;
  std::unique_ptr<simulation::Device> device_;
  MonoTime now_{1};
  double q_ = 0.3, dq_ = 0, wall_ = 1.0, most_torque_ = 0, load_ = 0, stop_at_ = 0;
  double viscous_ = 0.2;   // Nm s/rad, of a slide N s/m
  double inertia_ = 0.02;  // kg m^2, of a slide kg
  double gear_ = 1;
  bool is_there_ = true, is_wired_backwards_ = false;
  std::optional<double> fault_at_;
  std::string failure_;
};

TEST_F(Search, FindsTheStopAndNeverPullsHarderThanTold) {
  run(kWish);
  EXPECT_EQ(failure_, "");
  EXPECT_NEAR(stop_at_, 1.0, 0.006);
  EXPECT_GT(most_torque_, 0.8);
  EXPECT_LT(most_torque_, 1.03) << "the packed fields' quanta aside";
}

// Goal: a slide's stop is found in millimetres, with no more force than told. Method: 0.4 kg on 100 rad to a metre, 20
// mm before a wall; then a wall where it stands, and none.
TEST_F(Search, OfASlideItIsInMillimetres) {
  test::slide(robot_.joints[3]);
  constexpr StopWish kLength{.direction = 1, .speed = 0.005, .torque = 5, .within = 0.03};
  inertia_ = 0.4;
  gear_ = 100;
  viscous_ = 1;
  q_ = 0.01;
  wall_ = 0.03;
  use(robot_.joints[3].drive);
  run(kLength);
  EXPECT_EQ(failure_, "");
  EXPECT_NEAR(stop_at_, 0.03, 0.0003);
  EXPECT_GT(most_torque_, 4);
  EXPECT_LT(most_torque_, 6) << "the packed fields' quanta aside";
  run(kLength);
  EXPECT_NE(failure_.find("did not move"), std::string::npos) << failure_;
  wall_ = 1;
  run(kLength);
  EXPECT_EQ(failure_, "no stop within 30.0 mm");
}

TEST_F(Search, ADriveThatDoesNotKnowItsHomeIsLedAllTheSame) {
  config::Drive drive = robot_.joints[3].drive;
  drive.protocol = config::DriveProtocol::odrive;
  drive.watchdog_waiver = "a bench";
  drive.position_after_power_up = config::PositionAfterPowerUp::unknown;
  use(drive);
  run(kWish);
  EXPECT_EQ(failure_, "");
  EXPECT_NEAR(stop_at_, 0.7, 0.006) << "as it counts: from where it was switched on";
  EXPECT_LT(most_torque_, 1.1);
}

TEST_F(Search, WithoutAStopItEndsWhereItWasTold) {
  wall_ = 10;
  run(kWish);
  EXPECT_NE(failure_.find("no stop within"), std::string::npos) << failure_;
  EXPECT_LT(q_, 0.3 + 1.5 + 0.1);
}

TEST_F(Search, AJointThatDoesNotMoveIsInDoubt) {
  wall_ = 0.305;
  run(kWish);
  EXPECT_NE(failure_.find("did not move"), std::string::npos) << failure_;
}

TEST_F(Search, OneThatGoesTheOtherWayIsLetGo) {
  is_wired_backwards_ = true;
  run(kWish);
  EXPECT_NE(failure_.find("the other way"), std::string::npos) << failure_;
  EXPECT_GT(q_, 0.3 - 0.3);
}

TEST_F(Search, OneThatIsPulledAlongIsLetGo) {
  load_ = 3;
  run(kWish);
  EXPECT_NE(failure_.find("ran ahead"), std::string::npos) << failure_;
}

// It creeps along, and is neither there nor still.
TEST_F(Search, OneThatTakesTooLongIsLetGo) {
  viscous_ = 16;
  wall_ = 10;
  run(kWish);
  EXPECT_NE(failure_.find("took too long"), std::string::npos) << failure_;
  EXPECT_LT(q_, 1.8);
}

TEST_F(Search, AFaultOfTheDriveEndsIt) {
  fault_at_ = 0.6;
  run(kWish);
  EXPECT_EQ(failure_, "its drive reports over-current");
  EXPECT_LT(q_, 0.7);
}

TEST_F(Search, SoDoesSilence) {
  is_there_ = false;
  run(kWish);
  EXPECT_EQ(failure_, "no answer from its drive");
}

}  // namespace
}  // namespace takt::commissioning
