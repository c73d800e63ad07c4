// SPDX-License-Identifier: Apache-2.0
// Goal: no instruction at which a writer may die, and none at which a reader may be overtaken, yields anything but
// whole payloads. Method: single-step the compiled writer and read after every instruction; single-step the compiled
// reader and let the writer overtake it at every instruction. The wrong variants below must be caught by the same
// procedure.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "executive/ipc/ring_layout.hpp"
#include "executive/ipc/slot_ring.hpp"
#include "tests/executive/ipc/ring_memory.hpp"
#include "tests/executive/ipc/stepped_process.hpp"

namespace takt::ipc {
namespace {

constexpr RingShape kShape{8, 64, 1};
constexpr std::size_t kBytes = kShape.payload_capacity;
// Single steps spent on one kind of overtaking. An optimised build can afford every few instructions; where
// rounds are longer (sanitizers, no optimisation), fewer are tried.
constexpr int kStepBudget = 15'000;

#define SKIP_UNLESS_TRACED(process) \
  if (!(process).is_traced()) GTEST_SKIP() << "SKIPPED: ptrace is forbidden here, the interleavings were NOT tested"

Word* payload_words(std::byte* memory, std::uint64_t sequence) {
  return &shared_at<Word>(memory + slot_offset(kShape, sequence) + sizeof(SlotHeader));
}

// --- the writer dies at any instruction ---

// Steps through one publication; true when after every instruction a new reader gets payload `before` or the next,
// whole.
bool is_always_readable(SteppedProcess& writer, const RingMemory& memory, std::uint64_t before) {
  std::vector<std::byte> out(kBytes);
  std::uint64_t newest = before;
  for (bool goes_on = true; goes_on;) {
    goes_on = writer.step();
    auto reader = SlotReader::attach(memory.bytes(), kShape);
    const ReadResult result = reader->read_latest(out);
    if (result.status != ReadStatus::fresh || sequence_of(out) != result.sequence) return false;
    if (result.sequence < newest || result.sequence > before + 1) return false;
    newest = result.sequence;
  }
  return newest == before + 1;
}

TEST(WriterStepped, EveryInstructionLeavesTheRingReadable) {
  const RingMemory memory(kShape);
  SlotWriter writer(memory.bytes(), kShape);
  std::vector<std::vector<std::byte>> payloads;
  for (std::uint64_t sequence = 1; sequence <= 20; ++sequence) payloads.push_back(make_payload(sequence, kBytes));
  SteppedProcess process([&] { writer.publish(payloads[writer.published()]); });
  SKIP_UNLESS_TRACED(process);
  process.finish_round();
  for (std::uint64_t before = 1; before < payloads.size(); ++before) {
    ASSERT_TRUE(is_always_readable(process, memory, before)) << "publication " << before + 1;
  }
}

// Wrong: one slot for all, as a seqlock has. A writer that dies inside leaves no complete payload.
TEST(WriterStepped, OneSlotIsNotReadableAtEveryInstruction) {
  const RingMemory memory(kShape);
  SlotWriter(memory.bytes(), kShape).publish(make_payload(1, kBytes));
  const std::vector<std::byte> payload = make_payload(9, kBytes);
  const std::uint32_t crc = payload_crc(kBytes, payload, {});
  SteppedProcess process([&] {
    auto& slot = shared_at<SlotHeader>(memory.bytes().data() + slot_offset(kShape, 9));  // the slot of 1, too
    slot.version.store(version_while_writing(9));
    slot.size_and_crc.store(pack_size_and_crc(kBytes, crc));
    for (std::size_t i = 0; i < kBytes / 8; ++i) payload_words(memory.bytes().data(), 9)[i].store(payload_word(9, i));
    slot.version.store(version_when_complete(9));
    shared_at<RingHeader>(memory.bytes().data()).head.store(9);
  });
  SKIP_UNLESS_TRACED(process);
  EXPECT_FALSE(is_always_readable(process, memory, 1));
}

// Wrong: head is announced before the payload is there.
TEST(WriterStepped, AnnouncingHeadFirstIsNotReadableAtEveryInstruction) {
  const RingMemory memory(kShape);
  SlotWriter writer(memory.bytes(), kShape);
  writer.publish(make_payload(1, kBytes));
  const std::vector<std::byte> payload = make_payload(2, kBytes);
  SteppedProcess process([&] {
    shared_at<RingHeader>(memory.bytes().data()).head.store(2);
    writer.publish(payload);
  });
  SKIP_UNLESS_TRACED(process);
  EXPECT_FALSE(is_always_readable(process, memory, 1));
}

// --- the reader is overtaken at any instruction ---

struct Claim {
  ReadStatus status = ReadStatus::nothing_new;
  std::uint64_t sequence = 0;
  std::byte payload[kBytes] = {};
};

struct Rules {
  bool version_must_fit_head = true;
  bool looks_at_version_again = true;
};

// The reader's protocol without its checksum, with rules that can be left out.
template <Rules rules>
void claim_latest(const std::byte* memory, Claim& claim) {
  claim.sequence = shared_at<RingHeader>(memory).head.load(std::memory_order_acquire);
  const auto* const at = memory + slot_offset(kShape, claim.sequence);
  const auto& slot = shared_at<SlotHeader>(at);
  const std::uint64_t version = slot.version.load(std::memory_order_acquire);
  const auto* const words = &shared_at<Word>(at + sizeof(SlotHeader));
  for (std::size_t i = 0; i < kBytes / 8; ++i) {
    const std::uint64_t word = words[i].load(std::memory_order_acquire);
    std::memcpy(claim.payload + 8 * i, &word, 8);
  }
  bool accepted = version % 2 == 0;
  if (rules.version_must_fit_head) accepted = accepted && version == version_when_complete(claim.sequence);
  if (rules.looks_at_version_again) accepted = accepted && slot.version.load(std::memory_order_relaxed) == version;
  claim.status = accepted ? ReadStatus::fresh : ReadStatus::contended;
}

// What the writer does while the reader stands still.
struct Overtaking {
  const char* what;
  std::uint64_t publications;  // complete ones
  bool then_stops_inside;      // half of the next payload is stored, the other half after the reader went on
  bool marks_slot = true;      // false: a wrong writer that does not make the version odd first
};
constexpr Overtaking kOvertakings[] = {
    {"all other slots", 7, false},
    {"the whole ring once", 8, false},
    {"up to the middle of the reader's slot", 7, true},
    {"a second time up to the middle of the reader's slot", 15, true},
};

class OvertakenReader {
 public:
  // `read` gets the ring and a reader that has read nothing yet.
  explicit OvertakenReader(const std::function<void(const RingMemory&, SlotReader, Claim&)>& read)
      : process_([this, read] { read(memory_, reader_, claim()); }) {}
  [[nodiscard]] bool is_traced() const { return process_.is_traced(); }

  // Overtakes the reader at (nearly) every instruction of a round. Why a claim was wrong, or empty.
  std::string fault_under(const Overtaking& overtaking) {
    publish(1);
    process_.finish_round();  // the first round also binds symbols
    const int length = process_.instructions_per_round();
    const int stride = std::max(1, length / std::max(1, 2 * kStepBudget / length));
    for (int position = 0; position < length; position += stride) {
      publish(1);
      const std::uint64_t oldest = writer_.published();
      claim() = {};
      if (!process_.step(position)) continue;
      publish(overtaking.publications);
      if (overtaking.then_stops_inside) begin_next(overtaking.marks_slot);
      process_.finish_round();
      if (overtaking.then_stops_inside) publish(1);
      if (const std::string fault = fault_in_claim(oldest); !fault.empty()) {
        return fault + " at instruction " + std::to_string(position) + " under " + overtaking.what;
      }
    }
    return {};
  }

 private:
  Claim& claim() { return *reinterpret_cast<Claim*>(claim_memory_.bytes().data()); }

  void publish(std::uint64_t count) {
    for (std::uint64_t i = 0; i < count; ++i) writer_.publish(make_payload(writer_.published() + 1, kBytes));
  }
  void begin_next(bool marks_slot) {
    const std::uint64_t sequence = writer_.published() + 1;
    std::byte* const memory = memory_.bytes().data();
    auto& slot = shared_at<SlotHeader>(memory + slot_offset(kShape, sequence));
    if (marks_slot) slot.version.store(version_while_writing(sequence));
    for (std::size_t i = 0; i < kBytes / 16; ++i) payload_words(memory, sequence)[i].store(payload_word(sequence, i));
  }
  std::string fault_in_claim(std::uint64_t oldest) {
    const Claim& claimed = claim();
    if (claimed.status == ReadStatus::contended) return {};
    if (claimed.status != ReadStatus::fresh) return "an honest writer was called corrupt, or nothing was seen";
    const auto sequence = sequence_of(claimed.payload);
    if (!sequence) return "torn payload";
    if (*sequence != claimed.sequence) return "payload of another sequence";
    return *sequence < oldest ? "older payload than the newest" : "";
  }

  RingMemory memory_{kShape};
  RingMemory claim_memory_{{2, sizeof(Claim), 0}};
  SlotWriter writer_{memory_.bytes(), kShape};
  SlotReader reader_ = *SlotReader::attach(memory_.bytes(), kShape);
  SteppedProcess process_;
};

void read_as_shipped(const RingMemory&, SlotReader reader, Claim& claim) {
  const ReadResult result = reader.read_latest(claim.payload);
  claim.status = result.status;
  claim.sequence = result.sequence;
}

template <Rules rules>
void read_by(const RingMemory& memory, SlotReader, Claim& claim) {
  claim_latest<rules>(memory.bytes().data(), claim);
}

// The first fault that any overtaking brings about.
std::string first_fault(OvertakenReader& reader) {
  for (const Overtaking& overtaking : kOvertakings) {
    if (std::string fault = reader.fault_under(overtaking); !fault.empty()) return fault;
  }
  return {};
}

TEST(ReaderStepped, AsShippedIsNeverFooled) {
  OvertakenReader reader(read_as_shipped);
  SKIP_UNLESS_TRACED(reader);
  EXPECT_EQ(first_fault(reader), "");
}

TEST(ReaderStepped, VersionsAloneSufficeAgainstAnHonestWriter) {
  OvertakenReader reader(read_by<Rules{}>);
  SKIP_UNLESS_TRACED(reader);
  EXPECT_EQ(first_fault(reader), "");
}

TEST(ReaderStepped, WithoutTheSecondLookAtTheVersionPayloadsTear) {
  OvertakenReader reader(read_by<Rules{.looks_at_version_again = false}>);
  SKIP_UNLESS_TRACED(reader);
  const Overtaking to_the_middle{"up to the middle of the reader's slot", 7, true};
  EXPECT_EQ(reader.fault_under(to_the_middle).substr(0, 12), "torn payload");
}

TEST(ReaderStepped, WithoutFittingVersionToHeadPayloadsAreMislabelled) {
  OvertakenReader reader(read_by<Rules{.version_must_fit_head = false}>);
  SKIP_UNLESS_TRACED(reader);
  EXPECT_EQ(first_fault(reader).substr(0, 27), "payload of another sequence");
}

TEST(ReaderStepped, WithoutTheWritersOddMarkPayloadsTear) {
  OvertakenReader reader(read_by<Rules{}>);
  SKIP_UNLESS_TRACED(reader);
  EXPECT_EQ(reader.fault_under({"an unmarked overwrite", 7, true, false}).substr(0, 12), "torn payload");
}

}  // namespace
}  // namespace takt::ipc
