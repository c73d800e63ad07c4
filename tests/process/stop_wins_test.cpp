// SPDX-License-Identifier: Apache-2.0
// Goal: a stop wins over everything that hangs: the log's reader, the monitor (and with it the disk), the policy; and
// over a latched fault and a drive that is silent. Method: real processes on the loopback bus; the hang is made with
// full pipes and SIGSTOP; the time from the request to its frames is counted in ticks, by the executive's own records,
// which this test reads as a viewer. Nothing is judged by the wall clock.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <expected>
#include <fstream>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/ipc/descriptor.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"
#include "tests/process/running_robot.hpp"

namespace takt::test {
namespace {

using namespace std::chrono_literals;

// A pipe with a name that some program writes to, and that is read only when the test says so.
class UnreadPipe {
 public:
  explicit UnreadPipe(std::string path) : path_(std::move(path)) {
    EXPECT_EQ(mkfifo(path_.c_str(), 0600), 0);
    reader_ = ipc::Descriptor(open(path_.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
    EXPECT_TRUE(reader_.is_open());
  }
  [[nodiscard]] const std::string& path() const { return path_; }
  // From here on every writer to it blocks.
  void fill() const {
    const ipc::Descriptor writer(open(path_.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC));
    const std::string some(4096, '.');
    while (write(writer.get(), some.data(), some.size()) > 0) {
    }
    while (write(writer.get(), some.data(), 1) > 0) {
    }
  }
  // From here on every writer to it gets SIGPIPE.
  void close() { reader_.close(); }

 private:
  std::string path_;
  ipc::Descriptor reader_;
};

// One of the executive's record rings, as a viewer maps it.
class Ring {
 public:
  Ring(const ipc::Lease& lease, std::size_t descriptor, const ipc::RingShape& shape)
      : segment_(
            ipc::Segment::adopt_read_only(dup(lease.descriptors.at(descriptor).get()), ipc::ring_bytes(shape)).value()),
        reader_(ipc::SlotReader::attach(segment_.readable(), shape).value()) {}
  // Appends what is new.
  template <class Record>
  void read_into(std::vector<Record>& all) {
    Record record{};
    while (reader_.read_next(std::as_writable_bytes(std::span(&record, 1))).status == ipc::ReadStatus::fresh)
      all.push_back(record);
  }

 private:
  ipc::Segment segment_;
  ipc::SlotReader reader_;
};

// What the executive records, as a viewer sees it.
class Witness {
 public:
  explicit Witness(const RunningRobot& robot) : config_(config::load(robot.robot_file()).value()) {
    Hello hello;
    hello.role = Role::viewer;
    hello.config_hash = config_.hash;
    lease_ = ipc::attach(config::executive_socket(robot.directory()), hello, 5s).value();
    tick_ring_.emplace(lease_, ipc::kTickRingDescriptor, ipc::tick_ring(config_.joints.size()));
    frame_ring_.emplace(lease_, ipc::kFrameRingDescriptor, ipc::frame_ring());
  }

  // The first tick recorded that read `request`, once it and its frames are there; 20 s at most.
  const TickRecord* find(OperatorRequest request) {
    for (int poll = 0; poll < 2000; ++poll) {
      tick_ring_->read_into(ticks_);
      frame_ring_->read_into(frames_);
      const auto found = std::ranges::find_if(
          ticks_, [request](const TickRecord& record) { return record.header.operator_request == request; });
      if (found != ticks_.end() && found + 1 != ticks_.end()) return &*found;
      std::this_thread::sleep_for(10ms);
    }
    return nullptr;
  }
  // A stop was heard, and these are the ticks that began since, the one that read it included.
  [[nodiscard]] std::size_t ticks_until_read(const TickRecord& read) const {
    return static_cast<std::size_t>(std::ranges::count_if(ticks_, [&read](const TickRecord& record) {
      return record.header.now > read.header.asked_at && record.header.tick <= read.header.tick;
    }));
  }
  [[nodiscard]] std::size_t frames_sent_in(std::uint64_t tick) const {
    return static_cast<std::size_t>(std::ranges::count_if(frames_, [tick](const FrameRecord& frame) {
      return frame.tick == tick && frame.direction == FrameDirection::sent;
    }));
  }
  [[nodiscard]] std::size_t joints() const { return config_.joints.size(); }

 private:
  config::RobotConfig config_;
  ipc::Lease lease_;
  std::optional<Ring> tick_ring_, frame_ring_;
  std::vector<TickRecord> ticks_;
  std::vector<FrameRecord> frames_;
};

void expect_served(Witness& witness, OperatorRequest request, Mode mode) {
  const TickRecord* const read = witness.find(request);
  ASSERT_NE(read, nullptr) << "no tick read the request";
  EXPECT_LE(witness.ticks_until_read(*read), 2U);
  EXPECT_GE(witness.frames_sent_in(read->header.tick), witness.joints()) << "every drive is told in that very tick";
  EXPECT_EQ(name(read->header.mode), name(mode));
  for (std::size_t j = 0; j < witness.joints(); ++j)
    EXPECT_TRUE(mode != Mode::standby || read->joints[j].drive_enabled == 0) << j;
}

// As `takt stop` does it.
std::expected<OperatorReply, std::string> ask(const RunningRobot& robot, OperatorVerb verb) {
  return ipc::ask(config::executive_socket(robot.directory()), verb, 5s);
}

TEST(StopWins, WhileTheLogTheMonitorAndThePolicyHang) {
  RunningRobot robot;
  ASSERT_TRUE(robot.wait_for_mode(Mode::standby)) << robot.logs();  // it hears signals
  robot.executive().signal(SIGTERM);
  ASSERT_EQ(robot.executive().wait(20s), 0);
  UnreadPipe log(robot.directory() + "/executive.pipe");
  robot.executive() = robot.start_executive(log.path());
  const Child policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  Witness witness(robot);

  log.fill();
  robot.monitor().signal(SIGSTOP);
  policy.signal(SIGSTOP);
  EXPECT_TRUE(ask(robot, OperatorVerb::press_stop)) << robot.logs();
  expect_served(witness, OperatorRequest::press_stop, Mode::damped_stop);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(ask(robot, OperatorVerb::mark)) << "logs a line";
  EXPECT_TRUE(ask(robot, OperatorVerb::deenergise)) << robot.logs();
  expect_served(witness, OperatorRequest::deenergise, Mode::standby);

  robot.executive().signal(SIGTERM);
  EXPECT_EQ(robot.executive().wait(20s), 0) << "a signal is served as well, and the end does not wait for the log";
  robot.monitor().signal(SIGCONT);
  policy.signal(SIGCONT);
}

TEST(StopWins, AfterTheReaderOfTheLogHasGone) {
  RunningRobot robot;
  ASSERT_TRUE(robot.wait_for_mode(Mode::standby)) << robot.logs();  // it hears signals
  robot.executive().signal(SIGTERM);
  ASSERT_EQ(robot.executive().wait(20s), 0);
  UnreadPipe log(robot.directory() + "/executive.pipe");
  robot.executive() = robot.start_executive(log.path());
  const Child policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  Witness witness(robot);

  log.close();
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(ask(robot, OperatorVerb::mark)) << "logs a line";
  EXPECT_TRUE(ask(robot, OperatorVerb::press_stop)) << robot.logs();
  expect_served(witness, OperatorRequest::press_stop, Mode::damped_stop);
  robot.executive().signal(SIGTERM);
  EXPECT_EQ(robot.executive().wait(20s), 0);
}

// A drive that is never heard again: the fault stays latched, a first stop changes nothing and says so, a second one
// takes the power away, and the robot is in standby although the fault is still there.
TEST(StopWins, OverALatchedFaultWithASilentDrive) {
  const std::string scenario = testing::TempDir() + "takt-silent-for-ever.yaml";
  std::ofstream(scenario) << "schema: takt.scenario/1\nevents:\n"
                             "  - { after: enabled, at: 200 ms, joint: elbow, fault: silent, for: 600 s }\n";
  RunningRobot robot(scenario);
  const Child policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::fault_latched)) << robot.logs();
  Witness witness(robot);

  EXPECT_EQ(ask(robot, OperatorVerb::reset).value().done, 0) << "the fault still holds";
  EXPECT_TRUE(ask(robot, OperatorVerb::press_stop)) << robot.logs();
  expect_served(witness, OperatorRequest::press_stop, Mode::fault_latched);
  const auto deenergised = robot.wait_until([&robot](const StatusSnapshot& status) {
    if (status.tick.mode == Mode::standby) return true;
    (void)ask(robot, OperatorVerb::press_stop);
    return false;
  });
  ASSERT_TRUE(deenergised.has_value());
  EXPECT_EQ(deenergised->status.tick.mode, Mode::standby) << robot.logs();
  EXPECT_EQ(deenergised->status.tick.drives_enabled, 0);
}

}  // namespace
}  // namespace takt::test
