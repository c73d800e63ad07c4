// SPDX-License-Identifier: Apache-2.0
// Goal: a neighbour on the network fills no log, and packets that did not come by the robot file's interface are not
// read. Method: a real participant of Cyclone DDS on the loopback, in a network namespace of its own that has a second
// interface; malformed packets come over the loopback, and over that interface as from another machine (frames sent
// into the other end of a veth pair). Cyclone DDS writes a line about each one that it reads: lines tell what was read.
#include "dds/neighbours.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <linux/if_packet.h>
#include <net/ethernet.h>
#include <net/if.h>
#include <netinet/ip.h>
#include <netinet/udp.h>
#include <sched.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "dds/domain.hpp"

namespace takt::dds {
namespace {

using namespace std::chrono_literals;

TEST(LineBudget, WritesTenLinesInTenSecondsAndCountsTheRest) {
  LineBudget budget;
  const LineBudget::Instant begin = LineBudget::Instant{} + 1h;
  int written = 0;
  for (int i = 0; i < 9'000; ++i) written += budget.take(begin + i * 1ms) ? 1 : 0;
  EXPECT_EQ(written, 10);
  EXPECT_EQ(budget.dropped(), 8'990U);
  EXPECT_EQ(budget.take(begin + 10s), 8'990U);
  EXPECT_EQ(budget.take(begin + 10s), 0U);
}

// A submessage that is longer than what is left of its packet.
std::vector<std::uint8_t> malformed() {
  std::vector<std::uint8_t> packet{'R', 'T', 'P', 'S', 2, 1, 1, 16};
  packet.insert(packet.end(), 12, 7);                     // of whom
  packet.insert(packet.end(), {0x15, 0x05, 0xF0, 0xFF});  // DATA
  packet.insert(packet.end(), 20, 0);
  return packet;
}

std::vector<std::uint16_t> ports_of(const std::set<int>& sockets) {
  std::vector<std::uint16_t> ports;
  for (const int socket : sockets) {
    sockaddr_in address{};
    socklen_t size = sizeof address;
    getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size);
    if (address.sin_addr.s_addr == INADDR_ANY) ports.push_back(ntohs(address.sin_port));
  }
  return ports;
}

void send_on_loopback(std::uint16_t port, int count) {
  const int socket = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in to{.sin_family = AF_INET, .sin_port = htons(port), .sin_addr = {htonl(INADDR_LOOPBACK)}, .sin_zero = {}};
  const auto packet = malformed();
  for (int i = 0; i < count; ++i)
    sendto(socket, packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  close(socket);
}

std::uint16_t checksum(const std::uint8_t* bytes, std::size_t size) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < size; i += 2) sum += static_cast<std::uint32_t>(bytes[i] << 8) + bytes[i + 1];
  while (sum >> 16) sum = (sum & 0xFFFF) + (sum >> 16);
  return htons(static_cast<std::uint16_t>(~sum));
}

// As from 10.9.0.2 on the wire at the near end: veth0, which is 10.9.0.1, or veth2, another network.
void send_from_outside(std::uint16_t port, int count, const char* far_end = "veth1") {
  const auto packet = malformed();
  std::vector<std::uint8_t> frame{2, 0, 0, 0, 0, 1, 2, 0, 0, 0, 0, 2, 0x08, 0x00};  // to, from, IPv4
  iphdr ip{};
  ip.version = 4;
  ip.ihl = 5;
  ip.ttl = 64;
  ip.protocol = IPPROTO_UDP;
  ip.tot_len = htons(static_cast<std::uint16_t>(sizeof ip + sizeof(udphdr) + packet.size()));
  ip.saddr = inet_addr("10.9.0.2");
  ip.daddr = inet_addr("10.9.0.1");
  ip.check = checksum(reinterpret_cast<const std::uint8_t*>(&ip), sizeof ip);
  udphdr udp{};
  udp.source = htons(40'000);
  udp.dest = htons(port);
  udp.len = htons(static_cast<std::uint16_t>(sizeof udp + packet.size()));
  const auto append = [&](const void* data, std::size_t size) {
    const auto* const bytes = static_cast<const std::uint8_t*>(data);
    frame.insert(frame.end(), bytes, bytes + size);
  };
  append(&ip, sizeof ip);
  append(&udp, sizeof udp);
  append(packet.data(), packet.size());
  const int socket = ::socket(AF_PACKET, SOCK_RAW, 0);
  sockaddr_ll to{};
  to.sll_family = AF_PACKET;
  to.sll_ifindex = static_cast<int>(if_nametoindex(far_end));
  to.sll_halen = ETH_ALEN;
  for (int i = 0; i < count; ++i)
    sendto(socket, frame.data(), frame.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  close(socket);
}

// What the process logged, dropped lines included.
class Heard {
 public:
  Heard() {
    spdlog::set_default_logger(
        std::make_shared<spdlog::logger>("", std::make_shared<spdlog::sinks::ostream_sink_mt>(text_, true)));
  }
  [[nodiscard]] std::size_t lines() const {
    const std::string text = text_.str();
    return static_cast<std::size_t>(std::ranges::count(text, '\n'));
  }
  [[nodiscard]] std::uint64_t packets() const { return lines() + dropped_lines(); }
  // Bounded; false: nothing came.
  [[nodiscard]] bool wait_for(std::uint64_t count) const {
    for (int i = 0; i < 1'000 && packets() < count; ++i) std::this_thread::sleep_for(10ms);
    return packets() >= count;
  }

 private:
  std::ostringstream text_;
};

std::optional<Domain> participant(const std::string& interface) {
  config::RobotConfig robot;
  robot.dds.emplace();
  robot.dds->domain = 93;
  robot.dds->interface = interface;
  auto domain = Domain::open(robot, "neighbours_test");
  if (!domain) std::fprintf(stderr, "%s\n", domain.error().c_str());
  return domain ? std::optional<Domain>(std::move(*domain)) : std::nullopt;
}

enum Code { kFine = 0, kNoNamespace = 10, kNoParticipant, kNothingHeard, kOutsideHeard, kLogFlooded, kOutsideDeaf };

constexpr const char* kNear =
    "ip link add veth0 address 02:00:00:00:00:01 type veth peer name veth1 && ip address add 10.9.0.1/24 dev veth0 && "
    "ip link set veth0 up && ip link set veth1 up";
constexpr const char* kElsewhere =
    "ip link add veth2 address 02:00:00:00:00:01 type veth peer name veth3 && ip address add 10.8.0.1/24 dev veth2 && "
    "ip link set veth2 up && ip link set veth3 up";

bool set_up(const char* commands) {
  return std::system(commands) == 0;
}

bool is_alone_on_a_network() {
  const int namespaces = CLONE_NEWNET | (geteuid() == 0 ? 0 : CLONE_NEWUSER);
  return unshare(namespaces) == 0 && set_up("ip link set lo up") && set_up(kNear) && set_up(kElsewhere);
}

int on_the_loopback() {
  const Heard heard;
  const auto domain = participant("lo");
  if (!domain) return kNoParticipant;
  const auto ports = ports_of(datagram_sockets());
  if (ports.empty()) return kNoParticipant;
  const std::uint64_t before = heard.packets();
  send_from_outside(ports.front(), 200);
  send_on_loopback(ports.front(), 1);  // comes behind those, where they are read at all
  if (!heard.wait_for(before + 1)) return kNothingHeard;
  if (heard.packets() > before + 1) return kOutsideHeard;
  send_on_loopback(ports.front(), 5'000);
  if (!heard.wait_for(before + 100)) return kNothingHeard;
  return heard.lines() <= 2 * LineBudget::kLines ? kFine : kLogFlooded;
}

// What the file names is heard, also when it went and came back; another network is not.
int on_the_other_interface() {
  const Heard heard;
  const auto domain = participant("veth0");
  if (!domain) return kNoParticipant;
  const auto ports = ports_of(datagram_sockets());
  const std::uint64_t before = heard.packets();
  send_from_outside(ports.front(), 5);
  if (!heard.wait_for(before + 5)) return kOutsideDeaf;
  send_from_outside(ports.front(), 200, "veth3");
  send_on_loopback(ports.front(), 1);  // comes behind those, where they are read at all
  if (!heard.wait_for(before + 6)) return kNothingHeard;
  if (heard.packets() > before + 6) return kOutsideHeard;
  // As a network adapter that is plugged in again.
  if (!set_up("ip link del veth0") || !set_up(kNear)) return kNoNamespace;
  send_from_outside(ports.front(), 5);
  return heard.wait_for(before + 11) ? kFine : kOutsideDeaf;
}

int in_a_namespace(int (*test)()) {
  const pid_t child = fork();
  if (child == 0) {
    alarm(60);
    _exit(is_alone_on_a_network() ? test() : kNoNamespace);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

class Neighbours : public testing::TestWithParam<int (*)()> {};

// Threat: dds-flood
TEST_P(Neighbours, AreHeardByTheInterfaceOfTheFileAndWithinTheBudget) {
  const int code = in_a_namespace(GetParam());
  if (code == kNoNamespace && std::getenv("TAKT_REQUIRE_NAMESPACES") == nullptr)
    GTEST_SKIP() << "NO NETWORK NAMESPACE MAY BE MADE HERE: NOT TESTED";
  EXPECT_EQ(code, kFine);
}

INSTANTIATE_TEST_SUITE_P(, Neighbours, testing::Values(&on_the_loopback, &on_the_other_interface),
                         [](const auto& one) { return one.index == 0 ? "loopback" : "other_interface"; });

}  // namespace
}  // namespace takt::dds
