// SPDX-License-Identifier: Apache-2.0
// Any messages on the executive's sockets, read by its end and by a client's. The server answers each with one whole
// message, keeps one lease for each role, tells its owner nothing that a client may not say, and is free again when all
// have hung up. A client gets an answer that can be shown, or a sentence.
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

#include "cli/run/status_text.hpp"
#include "executive/contract/contract_layout.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/stop_line.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "tests/fuzz/peer.hpp"
#include "tests/fuzz/refused_with_a_sentence.hpp"
#include "tests/fuzz/scratch.hpp"
#include "tests/fuzz/source.hpp"

namespace {

using namespace takt;
using namespace takt::ipc;
using fuzz::require;
using fuzz::Source;

constexpr std::chrono::milliseconds kPatience{2000};

template <class Message>
std::string bytes_of(const Message& message) {
  return {reinterpret_cast<const char*>(&message), sizeof message};
}

// Sound but for what the input writes over it, or the input alone.
template <class Message>
std::string message_from(Source& source, Message sound) {
  if (source.byte() % 4 == 0) return source.text();
  source.spoil(sound);
  return bytes_of(sound);
}

template <std::size_t kBytes>
std::string_view text_of(const char (&text)[kBytes]) {
  require(text[kBytes - 1] == '\0');
  return text;
}

Hello sound_hello(Role role) {
  Hello hello;
  hello.role = role;
  hello.layout = contract_layout();
  hello.program[0] = 'f';
  return hello;
}

// The server, with an owner that checks what it is told, and some clients of raw sockets.
class Server {
 public:
  Server() : server_(RendezvousServer::listen(path(), geteuid(), handlers()).value()) {}

  void step(Source& source) {
    const std::uint8_t what = source.byte();
    Descriptor& client = clients_[what % clients_.size()];
    const auto role = static_cast<Role>(what / 16 % kRoleCount);
    if (!client.is_open()) {
      client = open_seqpacket(SOCK_NONBLOCK);
      require(connect_to(client, path()));
    } else if ((what & 4U) != 0) {
      client.close();
    } else if ((what & 8U) != 0) {
      say(client, message_from(source, sound_hello(role)));
    } else if (role == Role::monitor) {
      say(client, message_from(source, RecorderWord{.through_tick = 7}));
    } else if (is_policy(role)) {
      say(client, (what & 1U) != 0 ? std::string(1, '\1') : message_from(source, PolicyWord{}));
    } else {
      const std::string text = (what & 1U) != 0 ? source.text() : std::string();
      say(client, message_from(source, OperatorMessage{.verb = static_cast<OperatorVerb>(what / 16 % 9)}) + text);
    }
    serve();
  }
  void end() {
    for (Descriptor& client : clients_) client.close();
    serve();
    for (std::size_t role = 0; role < kRoleCount; ++role) require(server_.holder(static_cast<Role>(role)) == nullptr);
    require(leases_ == 0);
  }

 private:
  static std::string path() { return fuzz::scratch_folder() + "/run/executive.sock"; }

  RendezvousServer::Handlers handlers() {
    const auto check = [](const Peer& peer) {
      require(static_cast<std::size_t>(peer.hello.role) < kRoleCount && peer.pid == getpid());
      fuzz::require_printable(text_of(peer.hello.program));
    };
    return {.admit =
                [this, check](const Peer& peer) {
                  check(peer);
                  if (peer.hello.policy_hash % 3 == 1) return Admission{"the owner refuses", {}};
                  ++leases_;
                  return Admission{{}, {0}};
                },
            .acknowledged = [](const Peer& peer) { require(is_policy(peer.hello.role)); },
            .recorded = [](const Peer& peer, std::uint64_t) { require(peer.hello.role == Role::monitor); },
            .said =
                [this](const Peer& peer, const PolicyWord& word) {
                  require(is_policy(peer.hello.role) && word.role == peer.hello.role);
                  require(static_cast<std::size_t>(word.kind) < kPolicyWordKindCount);
                  fuzz::require_printable(text_of(word.sentence));
                  server_.pass_on(word);
                },
            .left = [this](const Peer&) { require(leases_-- > 0); },
            .request =
                [](const Peer& peer, const OperatorMessage& message, std::string_view text) {
                  require(peer.hello.role == Role::operator_console);
                  require(static_cast<std::size_t>(message.verb) < kOperatorVerbCount);
                  require(text.size() <= kLongestMark && (text.empty() || message.verb == OperatorVerb::mark));
                  fuzz::require_printable(text);
                  return OperatorReply{};
                }};
  }
  static void say(const Descriptor& client, const std::string& message) {
    (void)send_message(client.get(), std::as_bytes(std::span(message)), {});
  }
  void serve() {
    for (int round = 0; round < 3; ++round) server_.serve(std::chrono::milliseconds(0));
    for (const Descriptor& client : clients_)
      if (client.is_open()) hear(client);
  }
  // Every answer is a whole welcome or reply; a refusal says why.
  static void hear(const Descriptor& client) {
    union {
      Welcome welcome;
      OperatorReply reply;
      std::byte bytes[sizeof(OperatorReply) + 1];
    } said{};
    while (true) {
      const Received received = receive_message(client.get(), said.bytes, MSG_DONTWAIT);
      if (received.size <= 0) return;
      if (received.size == sizeof said.reply || received.size == sizeof(PolicyWord)) continue;
      require(received.size == sizeof said.welcome && said.welcome.magic == kMagic);
      require(received.descriptors.size() == said.welcome.descriptor_count);
      if (said.welcome.status == WelcomeStatus::refused)
        fuzz::require_sentence(text_of(said.welcome.sentence));
      else
        require(said.welcome.sentence[0] == '\0');
    }
  }

  int leases_ = 0;
  RendezvousServer server_;
  std::array<Descriptor, 4> clients_;
};

void serve(Source& source) {
  Server server;
  for (int i = 0; i < 32 && !source.is_empty(); ++i) server.step(source);
  server.end();
}

void show(const OperatorReply& reply) {
  for (const std::string& sentence : cli::sentences_of(reply)) fuzz::require_sentence(sentence);
  fuzz::require_printable(cli::incident_sentence(reply.incident));
  fuzz::require_printable(cli::status_text(reply.status, reply.incident));
  fuzz::require_printable(cli::status_line(reply.status, milliseconds(100)));
  (void)cli::status_json(reply.status, reply.incident).dump();
}

void attach_or_ask(Source& source) {
  const std::string path = fuzz::scratch_folder() + "/stranger.sock";
  const std::uint8_t what = source.byte();
  Welcome welcome;
  welcome.status = static_cast<WelcomeStatus>(what % 2);
  welcome.descriptor_count = static_cast<std::uint8_t>(what / 2 % 4);
  const std::array answers{message_from(source, welcome), message_from(source, OperatorReply{})};
  const std::array<int, 3> files{0, 0, 0};
  const std::size_t given = what / 8 % 4;
  const fuzz::Peer peer(fuzz::listening(path, SOCK_SEQPACKET), [&](int socket) {
    std::size_t with = given;
    for (const std::string& answer : answers) {
      if (!fuzz::hears(socket)) return;
      (void)send_message(socket, std::as_bytes(std::span(answer)), std::span(files).first(with));
      with = 0;
    }
  });
  if ((what & 32U) == 0) {
    const auto lease = attach(path, sound_hello(Role::viewer), kPatience);
    fuzz::check_refusal(lease);
    if (lease) require(lease->descriptors.size() == given && given <= kMaxDescriptors);
    return;
  }
  const auto reply = ask(path, static_cast<OperatorVerb>(what / 64), kPatience);
  fuzz::check_refusal(reply);
  if (reply) show(*reply);
}

// What is no stop is passed over; a stop behind it is heard.
void stop(Source& source) {
  const std::string path = fuzz::scratch_folder() + "/stop.sock";
  StopLine line = StopLine::listen(path).value();
  const Descriptor sender(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  require(connect_to(sender, path));
  for (int i = 0; i < 4 && !source.is_empty(); ++i) {
    const std::string message = message_from(source, OperatorMessage{});
    (void)send(sender.get(), message.data(), message.size(), MSG_DONTWAIT);
  }
  require(hand_over_stop(path, OperatorVerb::press_stop));
  const auto heard = line.wait();
  require(heard && is_stop(*heard));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Source source({data, size});
  switch (source.byte() % 8) {
    case 0:
      stop(source);
      break;
    case 1:
    case 2:
    case 3:
      attach_or_ask(source);
      break;
    default:
      serve(source);
  }
  return 0;
}
