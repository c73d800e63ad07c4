// SPDX-License-Identifier: Apache-2.0
// Goal: wake-ups are measured under the conditions of the executive's loop, with what disturbed them meanwhile. Method:
// known lateness; planted /dev and /proc whose files the test changes at instants that it can tell from the outside.
#include "systemd/doctor/wakeup_probe.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "executive/ipc/descriptor.hpp"
#include "systemd/doctor/interference.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::doctor {
namespace {

namespace fs = std::filesystem;

constexpr ProbePlan kPlan{
    .length = milliseconds(20), .period = milliseconds(1), .priority = 1, .cpu = 1, .load_in = {}};

class PlantedProbe : public testing::Test {
 protected:
  PlantedProbe() {
    for (const char* folder : {"/dev/cpu/0", "/dev/cpu/1", "/proc"}) fs::create_directories(root_.path() + folder);
  }
  // As the msr driver: the register's number is the place in the file.
  void plant_smi_count(int cpu, std::uint64_t value) const {
    std::string registers(0x34, '\xee');
    registers.append(reinterpret_cast<const char*>(&value), sizeof value).append(16, '\xee');
    std::ofstream(root_.path("dev/cpu/" + std::to_string(cpu) + "/msr")) << registers;
  }
  void plant_stat(const std::string& text) const { std::ofstream(root_.path("proc/stat")) << text; }
  [[nodiscard]] std::string stat() const { return root_.path("proc/stat"); }

  // Returns once a reader waits in open(). Not open: no reader came within ten seconds.
  [[nodiscard]] static ipc::Descriptor open_when_read(const std::string& fifo) {
    for (int attempt = 0; attempt < 10'000; ++attempt) {
      ipc::Descriptor writer(open(fifo.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC));
      if (writer.is_open()) return writer;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return {};
  }
  static void say(const ipc::Descriptor& to, const std::string& text) {
    ASSERT_EQ(write(to.get(), text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  static short events_of(const ipc::Descriptor& reader) {
    pollfd look{reader.get(), POLLIN, 0};
    return poll(&look, 1, 0) < 0 ? short{-1} : look.revents;
  }
  const test::TemporaryDirectory root_;
};

// Goal: sleep states are forbidden before the first wake-up until after the last, and the counts are differences over
// just that time, of the measured core. Method: the probe stops twice, where it opens /proc/stat, a FIFO: before and
// after it measures. At both the test looks at the other end of /dev/cpu_dma_latency, a FIFO too, and sets the
// counters.
TEST_F(PlantedProbe, HoldsTheProcessorAwakeAndCountsMeanwhile) {
  const std::string device = root_.path("dev/cpu_dma_latency");
  ASSERT_EQ(mkfifo(device.c_str(), 0600), 0);
  ASSERT_EQ(mkfifo(stat().c_str(), 0600), 0);
  const ipc::Descriptor held(open(device.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  plant_smi_count(0, 0);
  plant_smi_count(1, 0xee00000000000005);  // what is reserved is no part of the count

  WakeupLatency latency;
  std::jthread probe([&] { latency = measure_wakeups(kPlan, root_.path()); });
  {
    const ipc::Descriptor before = open_when_read(stat());
    ASSERT_TRUE(before.is_open()) << "nothing was counted before the measurement";
    std::int32_t allowed_us = -1;
    EXPECT_EQ(read(held.get(), &allowed_us, sizeof allowed_us), 4) << "not held before the measurement";
    EXPECT_EQ(allowed_us, 0);
    fs::remove(stat());  // the probe has opened it; next time it finds another
    ASSERT_EQ(mkfifo(stat().c_str(), 0600), 0);
    say(before, "cpu 9 9 9 9 9 9 9 9000 0 0\ncpu0 1 1 1 1 1 1 1 500 0 0\ncpu1 1 1 1 1 1 1 1 7 0 0\n");
  }
  {
    const ipc::Descriptor after = open_when_read(stat());
    ASSERT_TRUE(after.is_open()) << "nothing was counted after the measurement";
    EXPECT_EQ(events_of(held), 0) << "let go before the measurement had ended";
    plant_smi_count(0, 77);
    plant_smi_count(1, 0xee00000000000008);
    say(after, "cpu 9 9 9 9 9 9 9 9900 0 0\ncpu0 1 1 1 1 1 1 1 600 0 0\ncpu1 1 1 1 1 1 1 1 9 0 0\n");
  }
  probe.join();
  EXPECT_EQ(events_of(held), POLLHUP) << "still held";
  EXPECT_TRUE(latency.held_awake);
  EXPECT_EQ(latency.samples, 20U);
  EXPECT_EQ(latency.cpu, 1);
  EXPECT_EQ(latency.interference.smi_counter, SmiCounter::read);
  EXPECT_EQ(latency.interference.smis, 3U);
  EXPECT_EQ(latency.interference.stolen_ms, 2000 / sysconf(_SC_CLK_TCK));
}

TEST_F(PlantedProbe, SaysWhenItCouldNotHoldNorCount) {
  const WakeupLatency latency = measure_wakeups(kPlan, root_.path());
  EXPECT_FALSE(latency.held_awake);
  EXPECT_EQ(latency.interference.smi_counter, SmiCounter::no_driver);
  EXPECT_EQ(latency.interference.smis, 0U);
  EXPECT_FALSE(latency.interference.stolen_ms.has_value());
  fs::create_symlink("/dev/full", root_.path("dev/cpu_dma_latency"));
  EXPECT_FALSE(measure_wakeups(kPlan, root_.path()).held_awake) << "opened, but the request was refused";
}

// Goal: why a count could not be read decides what is advised, so it is told apart. Method: no file; one that ends
// before the register; one whose reading fails as the driver's does (EIO, as of our own memory where nothing is); one
// that only root may open.
TEST_F(PlantedProbe, WhyTheCountOfSmisCouldNotBeRead) {
  const std::string msr = root_.path("dev/cpu/0/msr");
  EXPECT_EQ(read_interference(root_.path(), 0).smi_counter, SmiCounter::no_driver);
  fs::create_symlink("/proc/self/mem", msr);
  EXPECT_EQ(read_interference(root_.path(), 0).smi_counter, SmiCounter::no_register);
  fs::remove(msr);
  std::ofstream(msr) << "short";
  EXPECT_EQ(read_interference(root_.path(), 0).smi_counter, SmiCounter::no_register);
  plant_smi_count(0, 4);
  EXPECT_EQ(read_interference(root_.path(), {}).smis, 4U) << "no core is named: core 0";
  fs::permissions(msr, fs::perms::none);
  const bool as_root = geteuid() == 0;
  ASSERT_TRUE(!as_root || seteuid(65534) == 0);  // an unprivileged user
  EXPECT_EQ(read_interference(root_.path(), 0).smi_counter, SmiCounter::refused);
  ASSERT_TRUE(!as_root || seteuid(0) == 0);
}

TEST_F(PlantedProbe, StolenTimeIsOfTheCoreOrOfAll) {
  plant_stat("cpu 1 1 1 1 1 1 1 300 0 0\ncpu1 1 1 1 1 1 1 1 7 0 0\ncpu11 1 1 1 1 1 1 1 9 0 0\ncpu2 1 1\n");
  const std::int64_t tick_ms = 1000 / sysconf(_SC_CLK_TCK);
  EXPECT_EQ(read_interference(root_.path(), {}).stolen_ms, 300 * tick_ms);
  EXPECT_EQ(read_interference(root_.path(), 1).stolen_ms, 7 * tick_ms);
  EXPECT_EQ(read_interference(root_.path(), 11).stolen_ms, 9 * tick_ms);
  EXPECT_FALSE(read_interference(root_.path(), 2).stolen_ms.has_value()) << "an old kernel's line has no eighth field";
  EXPECT_FALSE(read_interference(root_.path(), 3).stolen_ms.has_value()) << "no such core";
}

// The other cores' time, in which a machine without load shows itself; waiting for a disk is idle.
TEST_F(PlantedProbe, TheOthersTimeIsWithoutTheMeasuredCore) {
  plant_stat(
      "cpu 1 1 1 1 1 1 1 300 0 0\ncpu0 10 20 30 40 50 1 2 3 0 0\ncpu1 900 0 0 0 0 0 0 0 0 0\ncpu2 1 0 0 9 0 0 0 0\n");
  const auto others = read_interference(root_.path(), 1).others;
  ASSERT_TRUE(others.has_value());
  EXPECT_EQ(others->all_ticks, 156 + 10);
  EXPECT_EQ(others->busy_ticks, 66 + 1);
  plant_stat("cpu 1 1 1 1 1 1 1 300 0 0\ncpu1 900 0 0 0 0 0 0 0 0 0\n");
  EXPECT_FALSE(read_interference(root_.path(), 1).others.has_value()) << "there is no other";
  Interference before, after;
  before.others = {10, 100};
  after.others = {60, 200};
  EXPECT_EQ(interference_between(before, after).others->busy_ticks, 50);
  EXPECT_EQ(interference_between(before, after).others->all_ticks, 100);
}

TEST(Interference, IsCountedOnlyWhereItWasReadTwice) {
  const Interference early{SmiCounter::read, 0xfffffffe, 100, {}}, late{SmiCounter::read, 1, 140, {}};
  EXPECT_EQ(interference_between(early, late).smis, 3U) << "across the overflow of 32 bits";
  EXPECT_EQ(interference_between(early, late).stolen_ms, 40);
  EXPECT_EQ(interference_between(late, early).stolen_ms, 0) << "a kernel that counts backwards";
  const Interference unread{SmiCounter::refused, 0, {}, {}};
  for (const Interference& between : {interference_between(unread, late), interference_between(early, unread)}) {
    EXPECT_EQ(between.smi_counter, SmiCounter::refused);
    EXPECT_EQ(between.smis, 0U);
    EXPECT_FALSE(between.stolen_ms.has_value());
  }
}

TEST(WakeupProbe, QuantilesAndHistogramOfKnownLateness) {
  std::vector<std::int64_t> late;
  for (int i = 1; i <= 1000; ++i) late.push_back(i * 100);  // 0.1 .. 100 us
  const WakeupLatency latency = summarise(late, true);
  EXPECT_EQ(latency.samples, 1000U);
  EXPECT_EQ(latency.p50_ns, 50'000);
  EXPECT_EQ(latency.p99_ns, 99'000);
  EXPECT_EQ(latency.p999_ns, 99'900);
  EXPECT_EQ(latency.max_ns, 100'000);
  // [0,2) [2,4) [4,8) [8,16) [16,32) [32,64) [64,128) us
  EXPECT_EQ(latency.histogram, (std::vector<std::uint64_t>{19, 20, 40, 80, 160, 320, 361}));
}

TEST(WakeupProbe, TheRarestQuantileWantsAMillion) {
  std::vector<std::int64_t> late(kFewestForP99999, 5'000);
  std::fill_n(late.begin(), 15, 90'000);
  const WakeupLatency enough = summarise(late, true);
  EXPECT_EQ(enough.p99999_ns, 90'000);
  EXPECT_EQ(enough.beyond_p99999, 0U);
  std::fill_n(late.begin(), 9, 200'000);
  EXPECT_EQ(summarise(late, true).beyond_p99999, 9U);
  late.pop_back();
  EXPECT_FALSE(summarise(late, true).p99999_ns.has_value());
}

TEST(WakeupProbe, MeasuresAsManyPeriodsAsAsked) {
  const WakeupLatency latency =
      measure_wakeups({.length = milliseconds(50), .period = milliseconds(1), .priority = 1, .cpu = {}, .load_in = {}});
  EXPECT_EQ(latency.samples, 50U);
  EXPECT_GE(latency.max_ns, latency.p50_ns);
}

}  // namespace
}  // namespace takt::doctor
