// SPDX-License-Identifier: Apache-2.0
// Goal: the loopback bus is a bus: every node hears every other, a slow or dead node harms no other, a dead hub is
// noticed. Method: real sockets; three nodes in three processes for the exchange, the rest in one thread that pumps by
// hand.
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <thread>

#include "drivers/bus/loopback_bus.hpp"
#include "drivers/bus/loopback_hub.hpp"
#include "drivers/bus/loopback_socket.hpp"

namespace takt::drivers {
namespace {

std::string fresh_path(const char* name) {
  const std::filesystem::path directory = std::filesystem::path(testing::TempDir()) / "takt_loopback";
  std::filesystem::create_directories(directory);
  const std::string path = directory / name;
  std::filesystem::remove(path);
  return path;
}

CanFrame numbered(std::uint32_t id, std::uint8_t number) {
  CanFrame frame;
  frame.id = id;
  frame.length = 1;
  frame.data[0] = number;
  return frame;
}

class Loopback : public testing::Test {
 protected:
  void listen(const char* name, const BusOptions& options = {}) {
    path = fresh_path(name);
    auto made = LoopbackHub::listen(path, options);
    ASSERT_TRUE(made) << made.error();
    hub = std::move(*made);
  }
  std::unique_ptr<LoopbackBus> node(std::optional<std::vector<config::IdPattern>> wanted = {}) {
    auto made = LoopbackBus::connect(path, {"can0", false, std::move(wanted)});
    EXPECT_TRUE(made) << made.error();
    hub->pump({});
    return made ? std::move(*made) : nullptr;
  }

  std::string path;
  std::unique_ptr<LoopbackHub> hub;
  std::array<ReceivedFrame, 64> got;
};

// Policies' users share the group of the plant and the executive under systemd.
// Threat: policy-loopback
TEST_F(Loopback, ItsGroupHasNoWayToTheBus) {
  listen("closed");
  using std::filesystem::perms;
  EXPECT_EQ(std::filesystem::status(path).permissions(), perms::owner_read | perms::owner_write);
}

TEST_F(Loopback, EveryOtherNodeHearsAFrameAndTheSenderDoesNot) {
  listen("others");
  const auto a = node();
  const auto b = node();
  EXPECT_EQ(a->send(numbered(0x10, 1)), SendResult::sent);
  ASSERT_EQ(hub->receive(got), 1U) << "the hub's own node is one of the others";
  EXPECT_EQ(got[0].frame.id, 0x10U);
  ASSERT_EQ(b->receive(got), 1U);
  EXPECT_EQ(got[0].frame.data[0], 1);
  EXPECT_TRUE(got[0].received_at.is_set());
  EXPECT_LE(got[0].received_at, sample_clocks().monotonic);
  EXPECT_EQ(a->receive(got), 0U);
  hub->send(numbered(0x20, 2));
  EXPECT_EQ(a->receive(got), 1U);
  EXPECT_EQ(b->receive(got), 1U);
}

TEST_F(Loopback, CarriesFdFramesAndKeepsTheOrder) {
  listen("order");
  const auto a = node();
  const auto b = node();
  CanFrame fd = numbered(0x10, 0);
  fd.fd = fd.bit_rate_switch = true;
  fd.length = 64;
  fd.data[63] = 99;
  a->send(fd);
  for (std::uint8_t i = 1; i < 40; ++i) a->send(numbered(0x10, i));
  std::size_t passed = 0;
  for (int turn = 0; turn < 10 && passed < 40; ++turn) passed += hub->pump({});
  EXPECT_EQ(passed, 40U);
  ASSERT_EQ(b->receive(got), 40U);
  EXPECT_TRUE(got[0].frame.fd && got[0].frame.bit_rate_switch);
  EXPECT_EQ(got[0].frame.data[63], 99);
  for (std::uint8_t i = 1; i < 40; ++i) EXPECT_EQ(got[i].frame.data[0], i);
}

// Goal: who wants no id, as the executive on a bus without drives, hears nothing. Method: a frame to it and to a node
// that wants everything.
TEST_F(Loopback, WhoWantsNoIdHearsNothing) {
  listen("none");
  const auto a = node();
  const auto deaf = node(std::vector<config::IdPattern>{});
  const auto all = node();
  EXPECT_EQ(a->send(numbered(0x10, 1)), SendResult::sent);
  hub->pump({});
  EXPECT_EQ(deaf->receive(got), 0U);
  EXPECT_EQ(all->receive(got), 1U);
}

TEST_F(Loopback, ANodeSeesOnlyTheIdsItAskedFor) {
  listen("filter", {"can0", false, std::vector<config::IdPattern>{{0x30, 0x7FF, false}}});
  const auto a = node();
  const auto b = node(std::vector<config::IdPattern>{{0x10, 0x7FF, false}});
  a->send(numbered(0x10, 1));
  a->send(numbered(0x30, 2));
  CanFrame extended = numbered(0x10, 3);
  extended.extended = true;
  a->send(extended);
  EXPECT_EQ(hub->receive(got), 1U);
  EXPECT_EQ(got[0].frame.id, 0x30U);
  EXPECT_EQ(b->receive(got), 1U);
  EXPECT_EQ(got[0].frame.data[0], 1);
  EXPECT_EQ(b->receive(got), 0U);
}

TEST_F(Loopback, ANodeThatDoesNotReadLosesFramesForItselfOnly) {
  listen("slow");
  const auto talker = node();
  const auto slow = node();
  const auto quick = node();
  std::size_t heard = 0;
  constexpr std::size_t kFrames = 3000;
  for (std::size_t i = 0; i < kFrames; ++i) {
    ASSERT_EQ(talker->send(numbered(0x10, 1)), SendResult::sent);
    hub->pump({});
    heard += quick->receive(got);
  }
  EXPECT_EQ(heard, kFrames);
  EXPECT_GT(hub->health().tx_dropped, 0U);
  std::size_t kept = 0;
  for (std::size_t n = slow->receive(got); n > 0; n = slow->receive(got)) kept += n;
  EXPECT_EQ(kept + hub->health().tx_dropped, kFrames) << "every frame is either delivered or counted";
}

TEST_F(Loopback, AHubThatDoesNotPumpFillsTheSendersQueue) {
  listen("full");
  const auto a = node();
  SendResult result = SendResult::sent;
  for (int i = 0; i < 100'000 && result == SendResult::sent; ++i) result = a->send(numbered(0x10, 1));
  EXPECT_EQ(result, SendResult::queue_full);
  EXPECT_EQ(a->health().state, BusState::up);
  EXPECT_EQ(a->health().tx_dropped, 1U);
}

TEST_F(Loopback, AFullOutputLeavesTheRestForNextTime) {
  listen("room");
  const auto a = node();
  for (std::uint8_t i = 0; i < 10; ++i) a->send(numbered(0x10, i));
  std::array<ReceivedFrame, 4> four;
  EXPECT_EQ(hub->receive(four), 4U);
  EXPECT_EQ(hub->receive(four), 4U);
  EXPECT_EQ(four[0].frame.data[0], 4);
  EXPECT_EQ(hub->receive(four), 2U);
}

TEST_F(Loopback, ADeadHubIsABusThatIsDown) {
  listen("dead");
  const auto reader = node();
  const auto writer = node();
  hub.reset();
  EXPECT_EQ(reader->receive(got), 0U);
  EXPECT_EQ(reader->health().state, BusState::down);
  EXPECT_EQ(writer->send({}), SendResult::bus_down);
  EXPECT_EQ(writer->health().state, BusState::down);
  EXPECT_EQ(writer->receive(got), 0U);
}

TEST_F(Loopback, ANodeThatSendsNonsenseIsDisconnected) {
  listen("nonsense");
  const auto witness = node();
  FileHandle rogue = open_loopback_socket();
  const auto address = loopback_address(path);
  ASSERT_EQ(::connect(rogue.get(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address), 0);
  hub->pump({});
  EXPECT_EQ(hub->node_count(), 2U);
  ASSERT_EQ(::send(rogue.get(), "hello", 5, 0), 5);
  hub->pump({});
  EXPECT_EQ(hub->node_count(), 1U);
  EXPECT_EQ(witness->receive(got), 0U);
}

TEST_F(Loopback, ControllerStatesActOnANodeAsOnARealBus) {
  listen("states");
  const auto a = node();
  hub->report_error_state(BusState::error_passive);
  EXPECT_EQ(a->receive(got), 0U) << "error frames do not come out";
  EXPECT_EQ(a->health().state, BusState::error_passive);
  EXPECT_EQ(a->send(numbered(0x10, 1)), SendResult::sent) << "an error-passive node still takes part";
  EXPECT_EQ(hub->receive(got), 1U);

  ASSERT_EQ(a->send(numbered(0x10, 2)), SendResult::sent);
  hub->report_error_state(BusState::bus_off);
  hub->send(numbered(0x20, 3));
  EXPECT_EQ(hub->receive(got), 0U) << "a frame crossed a bus that is off";
  EXPECT_EQ(a->receive(got), 0U);
  EXPECT_EQ(a->health().state, BusState::bus_off);
  EXPECT_EQ(a->health().tx_dropped, 0U);
  EXPECT_EQ(a->send(numbered(0x10, 4)), SendResult::bus_down);
  EXPECT_EQ(a->health().tx_dropped, 1U);

  hub->report_error_state(BusState::up);
  EXPECT_EQ(a->receive(got), 0U);
  EXPECT_EQ(a->health().state, BusState::up);
  EXPECT_EQ(a->send(numbered(0x10, 5)), SendResult::sent);
  ASSERT_EQ(hub->receive(got), 1U);
  EXPECT_EQ(got[0].frame.data[0], 5) << "a stale frame came out after the restart";
  hub->report_error_state(BusState::down);
  a->receive(got);
  EXPECT_EQ(a->health().state, BusState::up) << "no controller says that";
}

TEST_F(Loopback, ARestartedControllerIsUpAgain) {
  listen("restarted");
  const auto a = node();
  CanFrame restarted;
  restarted.error = true;
  restarted.id = 0x100;
  restarted.length = 8;
  hub->report_error_state(BusState::error_passive);
  hub->send(restarted);
  EXPECT_EQ(a->receive(got), 0U);
  EXPECT_EQ(a->health().state, BusState::up);
}

TEST_F(Loopback, LossesAreCountedWhereAControllerCountsThem) {
  listen("losses");
  const auto a = node();
  const auto b = node();
  hub->report_receive_overflow();
  a->receive(got);
  EXPECT_EQ(a->health().rx_dropped, 1U);
  hub->inject({.refuse_transmit = true});
  EXPECT_EQ(a->send(numbered(0x10, 1)), SendResult::sent) << "the controller gives up later";
  EXPECT_EQ(hub->receive(got), 0U);
  EXPECT_EQ(a->receive(got), 0U);
  EXPECT_EQ(a->health().tx_dropped, 1U);
  EXPECT_EQ(b->receive(got), 0U);
  EXPECT_EQ(b->health().tx_dropped, 0U) << "the sender's loss only";
  hub->inject({});
  a->send(numbered(0x10, 2));
  EXPECT_EQ(hub->receive(got), 1U);
}

TEST_F(Loopback, DropsFramesOneWayAtATime) {
  listen("one_way");
  const auto a = node();
  hub->inject({.drop_from_nodes = true});
  a->send(numbered(0x10, 1));
  EXPECT_EQ(hub->receive(got), 0U);
  hub->send(numbered(0x20, 2));
  EXPECT_EQ(a->receive(got), 1U);
  EXPECT_EQ(a->health().tx_dropped, 0U) << "lost without a word";
  hub->inject({.drop_to_nodes = true});
  hub->send(numbered(0x20, 3));
  EXPECT_EQ(a->receive(got), 0U);
  a->send(numbered(0x10, 4));
  EXPECT_EQ(hub->receive(got), 1U);
}

TEST_F(Loopback, AStallFillsTheQueuesAndLetsTheBacklogFlowAfterwards) {
  listen("stall");
  const auto a = node();
  hub->inject({.stalled = true});
  std::size_t queued = 0;
  while (queued < 100'000 && a->send(numbered(0x10, 1)) == SendResult::sent) {
    ++queued;
    if (queued % 64 == 0) {
      EXPECT_EQ(hub->receive(got), 0U);
    }
  }
  EXPECT_LT(queued, 100'000U);
  EXPECT_EQ(a->health().tx_dropped, 1U);
  const auto late = node();
  EXPECT_EQ(hub->node_count(), 2U) << "a stalled bus still takes nodes";
  hub->inject({});
  std::size_t flowed = 0;
  for (std::size_t n = hub->receive(got); n > 0; n = hub->receive(got)) flowed += n;
  EXPECT_EQ(flowed, queued);
}

TEST_F(Loopback, ANodeMayNotSpeakForTheController) {
  listen("forged");
  const auto witness = node();
  const auto rogue = node();
  CanFrame forged;
  forged.error = true;
  forged.id = 0x40;
  forged.length = 8;
  rogue->send(forged);
  hub->pump({});
  EXPECT_EQ(hub->node_count(), 1U);
  witness->receive(got);
  EXPECT_EQ(witness->health().state, BusState::up);
}

TEST_F(Loopback, HoldsAtMostItsNumberOfNodes) {
  listen("crowd");
  std::vector<std::unique_ptr<LoopbackBus>> nodes;
  for (std::size_t i = 0; i < LoopbackHub::kMaxNodes + 2; ++i) nodes.push_back(node());
  EXPECT_EQ(hub->node_count(), LoopbackHub::kMaxNodes);
  EXPECT_EQ(nodes.back()->receive(got), 0U);
  EXPECT_EQ(nodes.back()->health().state, BusState::down);
}

TEST_F(Loopback, ALiveHubsSocketIsRespectedADeadOnesReplaced) {
  listen("twice");
  EXPECT_FALSE(LoopbackHub::listen(path, {}));
  // A hub that died without cleaning up: its socket file is there, no process answers.
  const std::string stale = fresh_path("stale");
  const auto address = loopback_address(stale);
  {
    const FileHandle left_behind = open_loopback_socket();
    ASSERT_EQ(::bind(left_behind.get(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address), 0);
  }
  EXPECT_TRUE(LoopbackHub::listen(stale, {}));
}

TEST_F(Loopback, TooLongAPathIsASentence) {
  const auto made = LoopbackHub::listen("/tmp/" + std::string(200, 'x'), {});
  ASSERT_FALSE(made);
  EXPECT_NE(made.error().find("shorter --runtime-dir"), std::string::npos);
}

// A node in a process of its own: says its number once all are there, and waits for the two others' numbers.
[[noreturn]] void be_a_node(const std::string& path, std::uint8_t number) {
  auto bus = LoopbackBus::connect(path, {"can0", false, {}});
  if (!bus) ::_exit(10);
  std::array<ReceivedFrame, 8> heard;
  unsigned seen = 0;
  for (int turn = 0; turn < 2000; ++turn) {
    (*bus)->send(numbered(0x100U + number, number));
    const std::size_t count = (*bus)->receive(heard);
    for (std::size_t i = 0; i < count; ++i) seen |= 1U << heard[i].frame.data[0];
    if ((seen & (1U << number)) != 0) ::_exit(11);  // heard itself
    if (seen == (0b111U & ~(1U << number)) && turn > 50) ::_exit(0);
    ::poll(nullptr, 0, 5);
  }
  ::_exit(12);
}

TEST_F(Loopback, ThreeProcessesHearEachOther) {
  listen("processes");
  std::vector<pid_t> children;
  for (std::uint8_t number = 0; number < 3; ++number) {
    const pid_t child = ::fork();
    if (child == 0) be_a_node(path, number);
    children.push_back(child);
  }
  for (const pid_t child : children) {
    int status = 0;
    while (::waitpid(child, &status, WNOHANG) == 0) hub->pump(milliseconds(20));
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 0) << "see be_a_node";
  }
}

// The hub pumped in a thread of its own while two nodes talk from theirs: for ThreadSanitizer.
TEST_F(Loopback, HubAndNodesInThreeThreads) {
  listen("threads");
  const auto a = node();
  const auto b = node();
  std::jthread pump([this](const std::stop_token& stop) {
    while (!stop.stop_requested()) hub->pump(milliseconds(2));
  });
  constexpr std::size_t kFrames = 500;
  const auto talk = [](LoopbackBus& bus) {
    std::array<ReceivedFrame, 64> heard;
    std::size_t count = 0;
    std::size_t sent = 0;
    for (int turn = 0; turn < 20'000 && (count < kFrames || sent < kFrames); ++turn) {
      // A few at a time, so that no queue overflows.
      for (int burst = 0; burst < 4 && sent < kFrames && sent < count + 64; ++burst)
        sent += bus.send(numbered(0x10, 1)) == SendResult::sent ? 1U : 0U;
      count += bus.receive(heard);
      ::poll(nullptr, 0, 1);
    }
    return count;
  };
  std::size_t heard_by_b = 0;
  std::jthread other([&] { heard_by_b = talk(*b); });
  EXPECT_EQ(talk(*a), kFrames);
  other.join();
  EXPECT_EQ(heard_by_b, kFrames);
}

}  // namespace
}  // namespace takt::drivers
