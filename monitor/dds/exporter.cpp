// SPDX-License-Identifier: Apache-2.0
#include "monitor/dds/exporter.hpp"

#include <spdlog/spdlog.h>
#include <time.h>

#include <cstring>
#include <utility>

#include "config/paths.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "monitor/dds/participant.hpp"
#include "monitor/dds/requests.hpp"

namespace takt::monitor::dds {
namespace {

constexpr auto kPatience = std::chrono::milliseconds(100);
constexpr auto kAnswerWithin = std::chrono::milliseconds(2000);
constexpr int kPatiencesUntilRetry = 50;

std::int64_t unix_now_ns() {
  timespec time{};
  clock_gettime(CLOCK_REALTIME, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

RequestAnswer answer(const Request& request, const Address& address, const std::string& socket) {
  const auto verb = judge(request, address, unix_now_ns());
  if (!verb) return {request.id, request.verb, false, verb.error()};
  const auto reply = ipc::ask(socket, *verb, kAnswerWithin);
  if (!reply) return {request.id, request.verb, false, "no executive answers: " + reply.error()};
  return {request.id, request.verb, reply->done != 0,
          std::string(reply->sentences, strnlen(reply->sentences, sizeof reply->sentences))};
}

}  // namespace

Exporter::Exporter(const config::RobotConfig& robot, std::string runtime_directory)
    : robot_(robot), runtime_directory_(std::move(runtime_directory)) {
  latest_.running = false;
  writer_ = std::thread([this] { write_until_closed(); });
}

Exporter::~Exporter() {
  outbox_.close();
  writer_.join();
  const Losses losses = outbox_.losses();
  const auto lost = [&](Channel channel) { return losses[static_cast<std::size_t>(channel)]; };
  if (losses != Losses{})
    spdlog::warn("DDS: not sent: {} joint states, {} diagnostics, {} status, {} command ages",
                 lost(Channel::joint_states), lost(Channel::diagnostics), lost(Channel::status),
                 lost(Channel::command_age));
}

void Exporter::write_until_closed() {
  std::string said;
  const std::string machine = machine_name();
  while (!outbox_.is_closed()) {
    const auto participant = Participant::open(robot_, machine);
    if (participant) {
      spdlog::info("DDS: domain {} on {}, machine {}{}", robot_.dds->domain, robot_.dds->interface, machine,
                   robot_.dds->allow_requests ? ", requests allowed" : "");
      return write_to(**participant);
    }
    if (participant.error() != said) {
      said = participant.error();
      spdlog::error("DDS: {}; recording goes on, ROS 2 hears nothing, trying again", said);
    }
    for (int i = 0; i < kPatiencesUntilRetry && !outbox_.is_closed(); ++i) {
      discard(outbox_.take(kPatience));
      std::this_thread::sleep_for(kPatience);
    }
  }
}

void Exporter::discard(const Outbox::Batch& batch) {
  outbox_.count_unsent(Channel::joint_states, batch.joint_states.size());
  outbox_.count_unsent(Channel::diagnostics, batch.diagnostics.size());
  outbox_.count_unsent(Channel::status, batch.status.size());
  outbox_.count_unsent(Channel::command_age, batch.command_ages.size());
}

// Status first: a subscriber may wait for it. The latest is written again when a request was answered meanwhile.
void Exporter::write_to(Participant& participant) {
  std::thread listener;
  if (robot_.dds->allow_requests) listener = std::thread([&] { answer_requests(participant); });
  const auto write_status = [&](const Status& status) {
    if (!participant.write(status, outbox_.losses(), latest_answer())) outbox_.count_unsent(Channel::status, 1);
  };
  write_status(latest_);
  std::uint64_t answers_written = 0;
  while (!outbox_.is_closed()) {
    const Outbox::Batch batch = outbox_.take(kPatience);
    const std::uint64_t answers = answers_given();
    for (const Status& status : batch.status) write_status(latest_ = status);
    if (batch.status.empty() && answers != answers_written) write_status(latest_);
    answers_written = answers;
    for (const Diagnostics& message : batch.diagnostics)
      if (!participant.write(message)) outbox_.count_unsent(Channel::diagnostics, 1);
    for (const CommandAge& message : batch.command_ages)
      if (!participant.write(message)) outbox_.count_unsent(Channel::command_age, 1);
    for (const JointStates& message : batch.joint_states)
      if (!participant.write(message)) outbox_.count_unsent(Channel::joint_states, 1);
  }
  if (listener.joinable()) listener.join();
}

// In the order they came: a stop behind a request to arm must find the robot armed. A request repeated in vain is
// logged once.
void Exporter::answer_requests(Participant& participant) {
  const std::string socket = config::executive_socket(runtime_directory_);
  std::string refused;
  while (!outbox_.is_closed()) {
    for (const Request& request : participant.take_requests(kPatience)) {
      RequestAnswer answered = answer(request, participant.address(), socket);
      if (answered.done)
        spdlog::warn("DDS: {} (request {})", answered.verb, answered.id);
      else if (answered.sentences != refused)
        spdlog::warn("DDS: {} refused (request {}): {}", answered.verb, answered.id, answered.sentences);
      refused = answered.done ? "" : answered.sentences;
      const std::lock_guard lock(answer_mutex_);
      answer_ = std::move(answered);
      ++answers_;
    }
  }
}

RequestAnswer Exporter::latest_answer() const {
  const std::lock_guard lock(answer_mutex_);
  return answer_;
}

std::uint64_t Exporter::answers_given() const {
  const std::lock_guard lock(answer_mutex_);
  return answers_;
}

}  // namespace takt::monitor::dds
