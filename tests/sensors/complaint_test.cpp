// SPDX-License-Identifier: Apache-2.0
// Goal: what is wrong is said when it begins and when it changes, and a sender of messages that are wrong in a new
// way each time, or wrong every second time, fills no log. Method: a logger into text, instants by hand.
#include "sensors/complaint.hpp"

#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>

#include <algorithm>
#include <memory>
#include <sstream>
#include <string>

namespace takt::sensors {
namespace {

class AComplaint : public testing::Test {
 protected:
  AComplaint() {
    spdlog::set_default_logger(
        std::make_shared<spdlog::logger>("", std::make_shared<spdlog::sinks::ostream_sink_st>(said_)));
  }
  ~AComplaint() override { spdlog::set_default_logger(before_); }
  [[nodiscard]] std::ptrdiff_t lines() const { return std::ranges::count(said_.str(), '\n'); }
  std::ostringstream said_;
  Complaint complaint_;
  static constexpr MonoTime kStart{5'000'000'000};

 private:
  std::shared_ptr<spdlog::logger> before_ = spdlog::default_logger();
};

TEST_F(AComplaint, IsSaidOnceAndAgainWhenItChangesOrIsOver) {
  for (int i = 0; i < 100; ++i) complaint_.say(kStart + seconds(i), "images are bgr8");
  EXPECT_EQ(lines(), 1);
  complaint_.say(kStart + seconds(100), "images are 4 x 4");
  EXPECT_EQ(lines(), 2);
  complaint_.forget();
  complaint_.say(kStart + seconds(102), "images are 4 x 4");
  EXPECT_EQ(lines(), 3);
}

TEST_F(AComplaint, OfWhatHappensOnceSoonAfterAnotherIsNotLost) {
  complaint_.say(kStart, "no such port");
  complaint_.say(kStart + milliseconds(200), "the port vanished");
  complaint_.say(kStart + milliseconds(300), "no such port");
  EXPECT_EQ(lines(), 3) << said_.str();
}

TEST_F(AComplaint, OfAStrangerWhoIsWrongInManyWaysIsALineASecondInTheEnd) {
  for (int i = 0; i < 3000; ++i) complaint_.say(kStart + milliseconds(i), "images are of " + std::to_string(i));
  EXPECT_EQ(lines(), 5 + 2) << said_.str();
}

TEST_F(AComplaint, OfEverySecondMessageIsALineASecondInTheEnd) {
  for (int i = 0; i < 3000; ++i) {
    complaint_.say(kStart + milliseconds(i), "images are bgr8");
    complaint_.forget();
  }
  EXPECT_EQ(lines(), 5 + 2) << said_.str();
}

}  // namespace
}  // namespace takt::sensors
