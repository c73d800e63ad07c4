// SPDX-License-Identifier: Apache-2.0
// Goal: between its first and its last tick the control thread allocates nothing, locks nothing, wakes no thread, and
// makes only the system calls that declared_syscalls.hpp lists. Method: the real loop, real drivers and real loopback
// buses, a policy that is played, a robot that is armed, all in a child process under the guard; then the same with one
// violation of each kind planted in the bus port, which the guard must name.
#include "tests/executive/runtime/loop_guard.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/eventfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include <condition_variable>
#include <functional>
#include <mutex>

#include "config/load.hpp"
#include "drivers/bus/open_bus.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "executive/runtime/cyclic_loop.hpp"
#include "executive/runtime/declared_syscalls.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "tests/executive/runtime/holding_policy.hpp"
#include "tests/executive/runtime/simulated_drives.hpp"
#include "tests/support/temporary_directory.hpp"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TAKT_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define TAKT_SANITIZED 1
#endif
#endif

namespace takt::runtime::test {
namespace {

constexpr std::uint64_t kTicks = 600;
constexpr std::uint64_t kArmAtTick = 150;

// What the child reports to the test.
struct Outcome {
  Findings findings;
  std::uint64_t ticks = 0;
  std::uint64_t commands = 0;
  bool was_tracking = false;
};

// A bus that commits a violation in every send.
class TroubledBus final : public drivers::CanBus {
 public:
  TroubledBus(std::unique_ptr<drivers::CanBus> bus, std::function<void()> trouble)
      : bus_(std::move(bus)), trouble_(std::move(trouble)) {}
  drivers::SendResult send(const drivers::CanFrame& frame) noexcept override {
    trouble_();
    return bus_->send(frame);
  }
  std::size_t receive(std::span<drivers::ReceivedFrame> out) noexcept override { return bus_->receive(out); }
  [[nodiscard]] BusHealth health() const noexcept override { return bus_->health(); }

 private:
  std::unique_ptr<drivers::CanBus> bus_;
  std::function<void()> trouble_;
};

DriveEdge make_edge(const config::RobotConfig& robot, const std::string& directory,
                    const std::function<void()>& trouble) {
  std::vector<std::unique_ptr<drivers::CanBus>> buses;
  for (std::size_t i = 0; i < robot.buses.size(); ++i) {
    buses.push_back(drivers::open_bus(robot.buses[i], directory, drivers::host_ids(robot, i)).value().bus);
  }
  if (trouble) buses[0] = std::make_unique<TroubledBus>(std::move(buses[0]), trouble);
  std::vector<JointOnBus> joints;
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    joints.push_back({drivers::make_joint_driver(robot, joint).value(), robot.joints[joint].bus});
  }
  config::SafeTorqueOff torque;
  torque.output = config::TorqueOutputKind::file;
  torque.file = directory + "/torque";
  return DriveEdge(std::move(buses), std::move(joints), std::make_unique<drivers::WireGuard>(robot),
                   drivers::open_torque_output(torque).value().output);
}

// Never returns: a thread under the filter cannot end, the process can.
[[noreturn]] void run_guarded(const std::string& directory, const std::function<void()>& trouble, int report_to) {
  const auto robot = config::load("config/arm6.yaml").value();
  const auto config = setup::tick_config_of(robot, 0);
  SimulatedDrives drives(robot, directory);
  DriveEdge edge = make_edge(robot, directory, trouble);
  SystemClock clock;
  PerSeat<MailboxHandover> mailboxes;
  OperatorInbox requests;
  RecordedThrough recorded;
  recorded.set(1);  // for the first four seconds that is not too far behind
  StatusBoard board;
  auto published = PublishedSegments::create(robot.joints.size()).value();
  CyclicLoop loop({config, clock, edge, mailboxes, requests, recorded, published, board},
                  {config::WakeMode::hybrid, microseconds(100), 100});

  auto segment = ipc::Segment::create("test-command", ipc::ring_bytes(ipc::command_mailbox()), false).value();
  HoldingPolicy policy(published.observation_descriptor(), segment.fd(), 1, 16, milliseconds(10));
  mailboxes[Seat::policy].want(CommandMailbox::seal(std::move(segment), 1).value());
  policy.start();

  Outcome outcome;
  std::atomic<bool> done = false;
  std::thread control([&] {
    const auto evidence = EvidenceSource::open().value();
    watch_this_thread();
    loop.run(evidence, kTicks);
    outcome.findings = stop_watching();
    done = true;
    while (true) clock.sleep_until(clock.now() + seconds(1));
  });
  ipc::SlotReader ticks = published.tick_reader();
  TickRecord record{};
  bool armed = false;
  while (!done) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    while (ticks.read_next(std::as_writable_bytes(std::span(&record, 1))).status == ipc::ReadStatus::fresh) {
      outcome.was_tracking |= record.header.mode == Mode::tracking;
      outcome.commands += record.header.seats[Seat::policy].arrival == Arrival::accepted ? 1U : 0U;
      if (record.header.tick >= kArmAtTick && !std::exchange(armed, true)) requests.arm();
    }
  }
  outcome.ticks = board.read().ticks;
  const bool reported = write(report_to, &outcome, sizeof outcome) == sizeof outcome;
  _exit(reported ? 0 : 1);
}

class LoopGuard : public testing::Test {
 protected:
  void SetUp() override {
#ifdef TAKT_SANITIZED
    GTEST_SKIP() << "a sanitizer allocates, locks and calls the kernel by itself: the guard judges plain builds only";
#endif
  }
  Outcome run(const std::function<void()>& trouble) {
    const takt::test::TemporaryDirectory directory;
    int pipe_ends[2];
    EXPECT_EQ(pipe(pipe_ends), 0);
    const pid_t child = fork();
    if (child == 0) {
      alarm(60);
      run_guarded(directory.path(), trouble, pipe_ends[1]);
    }
    close(pipe_ends[1]);
    Outcome outcome;
    EXPECT_EQ(read(pipe_ends[0], &outcome, sizeof outcome), static_cast<ssize_t>(sizeof outcome));
    close(pipe_ends[0]);
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << "the child ended with " << status;
    return outcome;
  }
};

TEST_F(LoopGuard, TheLoopIsClean) {
  const Outcome outcome = run({});
  EXPECT_EQ(outcome.findings.allocations, 0U);
  EXPECT_EQ(outcome.findings.locks, 0U);
  EXPECT_EQ(outcome.findings.undeclared_calls, 0U) << "first: system call " << outcome.findings.first_undeclared;
  EXPECT_EQ(outcome.ticks, kTicks);
  EXPECT_TRUE(outcome.was_tracking) << "the run must have walked the paths that matter";
  EXPECT_GT(outcome.commands, 5U);
}

TEST_F(LoopGuard, AnAllocationIsSeen) {
  const Outcome outcome = run([] { ::operator delete(::operator new(64)); });
  EXPECT_GT(outcome.findings.allocations, kTicks);
}

TEST_F(LoopGuard, AMutexIsSeenEvenWhenNobodyHoldsIt) {
  std::mutex mutex;
  const Outcome outcome = run([&] { const std::lock_guard lock(mutex); });
  EXPECT_GT(outcome.findings.locks, kTicks);
  EXPECT_EQ(outcome.findings.undeclared_calls, 0U) << "an uncontended mutex never reaches the kernel";
}

TEST_F(LoopGuard, AConditionVariableIsSeenEvenWhenNobodyWaits) {
  std::condition_variable condition;
  EXPECT_GT(run([&] { condition.notify_one(); }).findings.locks, kTicks);
}

TEST_F(LoopGuard, OpeningAFileIsSeen) {
  const Outcome outcome = run([] { EXPECT_EQ(open("/dev/null", O_RDONLY | O_CLOEXEC), -1); });
  EXPECT_GT(outcome.findings.undeclared_calls, kTicks);
  EXPECT_EQ(outcome.findings.first_undeclared, SYS_openat);
}

TEST_F(LoopGuard, WakingAnotherThreadIsSeen) {
  const int event = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  const Outcome outcome = run([event] { eventfd_write(event, 1); });
  EXPECT_GT(outcome.findings.undeclared_calls, kTicks);
  EXPECT_EQ(outcome.findings.first_undeclared, SYS_write);
  close(event);
}

}  // namespace
}  // namespace takt::runtime::test
