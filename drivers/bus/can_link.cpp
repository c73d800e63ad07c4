// SPDX-License-Identifier: Apache-2.0
#include "drivers/bus/can_link.hpp"

#include <linux/can/netlink.h>
#include <linux/if.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "drivers/bus/file_handle.hpp"

namespace takt::drivers {
namespace {

using Bytes = std::span<const std::byte>;

// The first bytes as a T; nothing where there are too few.
template <class T>
std::optional<T> first(Bytes bytes) {
  if (bytes.size() < sizeof(T)) return std::nullopt;
  T value;
  std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

Bytes behind(Bytes bytes, std::size_t count) {
  return bytes.subspan(std::min(bytes.size(), count));
}

// The payload of the attribute of that type; empty: there is none.
Bytes attribute(Bytes all, unsigned type) {
  while (const auto head = first<rtattr>(all)) {
    if (head->rta_len < sizeof(rtattr) || head->rta_len > all.size()) break;
    if ((head->rta_type & NLA_TYPE_MASK) == type) return all.first(head->rta_len).subspan(RTA_LENGTH(0));
    all = behind(all, RTA_ALIGN(head->rta_len));
  }
  return {};
}

std::string text(Bytes bytes) {
  const std::string all(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return all.substr(0, all.find('\0'));
}

const char* state_name(std::uint32_t state) {
  constexpr std::array kNames{"ERROR-ACTIVE", "ERROR-WARNING", "ERROR-PASSIVE", "BUS-OFF", "STOPPED", "SLEEPING"};
  return state < kNames.size() ? kNames[state] : "";
}

void read_timing(Bytes data, CanLink& link) {
  constexpr double kPerMille = 1e-3;
  if (const auto timing = first<can_bittiming>(attribute(data, IFLA_CAN_BITTIMING))) {
    link.bitrate = timing->bitrate;
    link.sample_point = timing->sample_point * kPerMille;
    link.sjw = timing->sjw;
  }
  if (const auto timing = first<can_bittiming>(attribute(data, IFLA_CAN_DATA_BITTIMING))) {
    link.data_bitrate = timing->bitrate;
    link.data_sample_point = timing->sample_point * kPerMille;
    link.data_sjw = timing->sjw;
  }
  if (const auto mode = first<can_ctrlmode>(attribute(data, IFLA_CAN_CTRLMODE)))
    link.fd = (mode->flags & CAN_CTRLMODE_FD) != 0;
  link.restart_ms = first<std::uint32_t>(attribute(data, IFLA_CAN_RESTART_MS)).value_or(0);
}

void read_controller(Bytes data, Bytes happened, CanLink& link) {
  if (const auto state = first<std::uint32_t>(attribute(data, IFLA_CAN_STATE)))
    link.controller_state = state_name(*state);
  if (const auto counters = first<can_berr_counter>(attribute(data, IFLA_CAN_BERR_COUNTER))) {
    link.transmit_errors = counters->txerr;
    link.receive_errors = counters->rxerr;
  }
  if (const auto counted = first<can_device_stats>(happened)) {
    link.bus_errors = counted->bus_error;
    link.went_passive = counted->error_passive;
    link.went_off = counted->bus_off;
    link.restarts = counted->restarts;
  }
}

struct Question {
  nlmsghdr head{};
  ifinfomsg body{};
  rtattr name_head{};
  char name[IFNAMSIZ]{};
};

Question question_about(const std::string& interface) {
  Question question;
  question.head.nlmsg_len = sizeof question;
  question.head.nlmsg_type = RTM_GETLINK;
  question.head.nlmsg_flags = NLM_F_REQUEST;
  question.body.ifi_family = AF_UNSPEC;
  question.name_head.rta_type = IFLA_IFNAME;
  question.name_head.rta_len = RTA_LENGTH(IFNAMSIZ);
  std::strncpy(question.name, interface.c_str(), IFNAMSIZ - 1);
  return question;
}

// A controller reads a bit at a whole time quantum: 0.666 is 0.65 or 0.7 where a bit has 20 of them.
constexpr double kSamplePointStep = 0.04;

std::string share(double value) {
  std::array<char, 16> written{};
  std::snprintf(written.data(), written.size(), "%.3f", value);
  return written.data();
}

// What the robot file asks for, against what the controller does; 0 asks for nothing.
std::string wrong_phase(const char* phase, double sample_point, double found, std::uint32_t sjw,
                        std::uint32_t sjw_found) {
  if (sample_point > 0 && std::abs(found - sample_point) > kSamplePointStep)
    return "sample point " + share(found) + phase + ", the robot file says " + share(sample_point);
  if (sjw > 0 && sjw_found != sjw)
    return "sjw " + std::to_string(sjw_found) + phase + ", the robot file says " + std::to_string(sjw);
  return {};
}

std::string wrong_bitrate(const char* phase, std::uint32_t wanted, std::uint32_t found) {
  return std::to_string(found) + " bit/s" + phase + ", the robot file says " + std::to_string(wanted) + " bit/s";
}

}  // namespace

std::string wrong_timing(const config::Bus& bus, const CanLink& link) {
  if (!link.exists || link.is_virtual || link.bitrate == 0) return {};
  if (link.bitrate != bus.bitrate) return wrong_bitrate("", bus.bitrate, link.bitrate);
  if (bus.fd && !link.fd) return "classic CAN, the robot file says FD";
  constexpr const char* kData = " for FD data";
  if (bus.fd && link.data_bitrate != bus.data_bitrate) return wrong_bitrate(kData, bus.data_bitrate, link.data_bitrate);
  if (std::string wrong = wrong_phase("", bus.sample_point, link.sample_point, bus.sjw, link.sjw); !wrong.empty())
    return wrong;
  return bus.fd ? wrong_phase(kData, bus.data_sample_point, link.data_sample_point, bus.data_sjw, link.data_sjw) : "";
}

CanLink can_link_of(std::span<const std::byte> answer) {
  CanLink link;
  const auto head = first<nlmsghdr>(answer);
  if (!head || head->nlmsg_type != RTM_NEWLINK || head->nlmsg_len > answer.size()) return link;
  const Bytes message = behind(answer.first(head->nlmsg_len), NLMSG_HDRLEN);
  const auto body = first<ifinfomsg>(message);
  if (!body) return link;
  const Bytes attributes = behind(message, NLMSG_ALIGN(sizeof(ifinfomsg)));
  link.exists = true;
  link.up = (body->ifi_flags & IFF_UP) != 0;
  link.queue_length = first<std::uint32_t>(attribute(attributes, IFLA_TXQLEN)).value_or(0);
  const Bytes info = attribute(attributes, IFLA_LINKINFO);
  link.kind = text(attribute(info, IFLA_INFO_KIND));
  link.is_virtual = link.kind != "can";
  const Bytes data = attribute(info, IFLA_INFO_DATA);
  read_timing(data, link);
  read_controller(data, attribute(info, IFLA_INFO_XSTATS), link);
  return link;
}

CanLink read_can_link(const std::string& interface) {
  const FileHandle socket(::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE));
  const Question question = question_about(interface);
  std::array<std::byte, 32768> answer{};
  if (!socket.is_open() || ::send(socket.get(), &question, sizeof question, 0) != sizeof question) return {};
  const ssize_t size = ::recv(socket.get(), answer.data(), answer.size(), 0);
  return size > 0 ? can_link_of(Bytes(answer).first(static_cast<std::size_t>(size))) : CanLink{};
}

}  // namespace takt::drivers
