// SPDX-License-Identifier: Apache-2.0
// Goal: a writer process that is killed or hostile costs its reader nothing but its own messages. Method: real
// processes on shared memory; SIGKILL at random instants; a child that scribbles over the whole segment or mutates
// payloads under a valid version while we read.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <random>

#include "executive/ipc/ring_layout.hpp"
#include "executive/ipc/slot_ring.hpp"
#include "tests/executive/ipc/ring_memory.hpp"

namespace takt::ipc {
namespace {

constexpr RingShape kShape{8, 512, 1};
constexpr std::chrono::seconds kPatience{30};  // only a broken run waits so long

// A child that runs `body` over and over until it is killed.
class Child {
 public:
  template <class Body>
  explicit Child(Body body) : pid_(fork()) {
    if (pid_ != 0) return;
    alarm(60);  // never outlive a test that was killed itself
    for (;;) body();
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() { kill_now(); }
  void kill_now() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = 0;
  }

 private:
  pid_t pid_;
};

template <class Condition>
bool eventually(Condition condition) {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
  }
  return true;
}

TEST(KilledWriter, LeavesACompletePayload400TimesOf400) {
  std::mt19937 random(20240601);
  for (int round = 0; round < 400; ++round) {
    const RingMemory memory(kShape);
    SlotWriter writer(memory.bytes(), kShape);
    auto reader = SlotReader::attach(memory.bytes(), kShape);
    std::vector<std::byte> payload = make_payload(1, 512);
    Child child([&] {
      const std::uint64_t sequence = writer.published() + 1;
      for (std::size_t i = 0; i < 64; ++i) {
        const std::uint64_t word = payload_word(sequence, i);
        std::memcpy(payload.data() + 8 * i, &word, 8);
      }
      writer.publish(payload);
    });
    const std::uint64_t enough = random() % 3000;
    const auto& head = shared_at<RingHeader>(memory.bytes().data()).head;
    ASSERT_TRUE(eventually([&] { return head.load() > enough; }));
    child.kill_now();

    std::vector<std::byte> out(kShape.payload_capacity);
    const ReadResult result = reader->read_latest(out);
    ASSERT_EQ(result.status, ReadStatus::fresh) << "round " << round;
    ASSERT_EQ(result.sequence, head.load());
    ASSERT_EQ(sequence_of(out), std::optional(result.sequence)) << "round " << round;
  }
}

TEST(HostileWriter, ScribblingOverEverythingIsBoundedAndNeverBelieved) {
  const RingMemory memory(kShape);
  SlotWriter(memory.bytes(), kShape).publish(make_payload(1, 512));
  auto reader = SlotReader::attach(memory.bytes(), kShape);
  std::mt19937_64 random(7);
  const Child child([&] {
    const std::size_t at = 8 * (random() % (memory.bytes().size() / 8));
    const std::uint64_t small = random() % 32;
    shared_at<Word>(memory.bytes().data() + at).store(random() % 2 == 0 ? small : random());
  });
  std::vector<std::byte> out(kShape.payload_capacity);
  std::uint64_t corrupt = 0;
  const bool was_tried = eventually([&] {
    for (const ReadResult& result : {reader->read_latest(out), reader->read_next(out)}) {
      EXPECT_LE(result.tries, kMaxTries);
      EXPECT_LE(result.size, kShape.payload_capacity);
      EXPECT_FALSE(result.status == ReadStatus::fresh && result.sequence > 1) << "noise with a matching checksum?";
      corrupt += result.status == ReadStatus::corrupt ? 1 : 0;
    }
    reader->skip_to_newest();
    return corrupt >= 500 || HasFailure();
  });
  EXPECT_TRUE(was_tried) << "only " << corrupt << " corrupt reads";
}

// The version stays valid while the payload changes: only the checksum can tell.
TEST(HostileWriter, MutatingUnderAValidVersionIsCorruptOrWhole) {
  const RingMemory memory(kShape);
  SlotWriter writer(memory.bytes(), kShape);
  std::vector<std::byte> out(kShape.payload_capacity);
  auto reader = SlotReader::attach(memory.bytes(), kShape);
  const std::vector<std::byte> payload = make_payload(1, 512);
  const Child child([&] {
    writer.publish(payload);
    Word* const words =
        &shared_at<Word>(memory.bytes().data() + slot_offset(kShape, writer.published()) + sizeof(SlotHeader));
    for (std::size_t flip = 0; flip < 128; ++flip) words[flip % 64].fetch_xor(0x40);  // every word there and back
  });
  std::uint64_t corrupt = 0;
  const bool was_tried = eventually([&] {
    const ReadResult result = reader->read_latest(out);
    EXPECT_LE(result.tries, kMaxTries);
    EXPECT_TRUE(result.status != ReadStatus::fresh || out == payload);
    corrupt += result.status == ReadStatus::corrupt ? 1 : 0;
    return corrupt >= 200 || testing::Test::HasFailure();
  });
  EXPECT_TRUE(was_tried) << "only " << corrupt << " corrupt reads";
}

}  // namespace
}  // namespace takt::ipc
