// SPDX-License-Identifier: Apache-2.0
#include "policy_host/remote/server.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstring>
#include <span>
#include <utility>

#include "executive/contract/monotonic_clock.hpp"
#include "policy_host/remote/machine_probe.hpp"
#include "policy_host/remote/silence.hpp"
#include "policy_host/remote/wire_messages.hpp"

namespace takt::policy_host::remote {
namespace {

MonoTime oldest(MonoTime joints, MonoTime outside) {
  return outside.is_set() ? std::min(joints, outside) : joints;
}

constexpr Duration kLook = microseconds(200);  // for an answer that is due
constexpr Duration kIdle = milliseconds(5);    // while none is
constexpr Duration kServerReportPeriod = seconds(10);
constexpr std::uint64_t kForget = 1000;  // a gap of ids after which every policy forgets (policy_host/continuity.hpp)

}  // namespace

Server::Server(const config::RobotConfig& robot, std::string name, std::uint64_t policy_hash, dds::Domain domain,
               std::unique_ptr<PolicySeat> seat, FarSamples samples)
    : robot_(robot),
      name_(std::move(name)),
      policy_hash_(policy_hash),
      number_(drawn_number()),
      address_(address_of(robot.dds->interface)),
      domain_(std::move(domain)),
      seat_(std::move(seat)),
      samples_(std::move(samples)) {}

std::expected<std::unique_ptr<Server>, std::string> Server::open(const config::RobotConfig& robot,
                                                                 const ServerOptions& options,
                                                                 std::uint64_t policy_hash) {
  auto seat = PolicySeat::open(
      robot, policy_hash,
      {.runtime_directory = options.runtime_directory,
       .server = "takt-policy-server",
       .policy_user = options.policy_user,
       .taken =
           [](const ipc::Peer& peer) { spdlog::info("policy attached: pid {} ({})", peer.pid, peer.hello.program); },
       .left = [] { spdlog::warn("the policy left"); },
       .turned_away = [](const ipc::Peer& peer,
                         const std::string& why) { spdlog::error("policy pid {}: {}", peer.pid, why); }});
  if (!seat) return std::unexpected(seat.error());
  auto samples = FarSamples::open(robot, options.runtime_directory, options.policy_user);
  if (!samples) return std::unexpected(samples.error());
  auto domain = dds::Domain::open(robot, "takt-policy-server " + robot.robot);
  if (!domain) return std::unexpected(domain.error());
  auto server = std::unique_ptr<Server>(
      new Server(robot, options.name, policy_hash, std::move(*domain), std::move(*seat), std::move(*samples)));
  if (auto opened = server->open_endpoints(); !opened) return std::unexpected(opened.error());
  return server;
}

std::expected<void, std::string> Server::open_endpoints() {
  const auto commands = make_writer(domain_, robot_, Topic::command);
  if (!commands) return std::unexpected(commands.error());
  const auto samples = make_reader(domain_, robot_, Topic::sample);
  if (!samples) return std::unexpected(samples.error());
  const auto observations = make_reader(domain_, robot_, Topic::observation);
  if (!observations) return std::unexpected(observations.error());
  const auto status = make_writer(domain_, robot_, Topic::status);
  if (!status) return std::unexpected(status.error());
  status_ = *status;
  commands_ = *commands;
  samples_reader_ = *samples;
  observations_ = *observations;
  wait_set_ = dds_create_waitset(domain_.participant());
  for (const dds_entity_t reader : {samples_reader_, observations_})
    dds_waitset_attach(wait_set_, dds_create_readcondition(reader, DDS_ANY_STATE), 0);
  return {};
}

void Server::run(const std::atomic<bool>& stop) {
  reported_ = monotonic_now();
  MonoTime served;
  while (!stop) {
    const bool is_due = unanswered_since_.is_set() && seat_->is_taken();
    dds_waitset_wait(wait_set_, nullptr, 0, is_due ? kLook.ns : kIdle.ns);
    // Samples first: the observation that names one was sent behind it.
    take_all<takt_remote_Sample>(samples_reader_, [this](const takt_remote_Sample& message, const PeerId& sender) {
      samples_.take(message, sender);
    });
    take_all<takt_remote_Observation>(
        observations_,
        [this](const takt_remote_Observation& message, const PeerId& sender) { take_observation(message, sender); });
    if (seat_->read(chunk_)) {
      seat_->serve();  // whose command it is, was said before
      answer();
    }
    const MonoTime now = monotonic_now();
    if (unanswered_since_.is_set() && now - unanswered_since_ > robot_.freshness.max_age) unanswered_since_ = {};
    if (now - served < kIdle) continue;
    served = now;
    seat_->serve();
    if (now - status_told_ >= Silence::status_period(robot_.freshness.max_age) || seat_->is_taken() != told_of_policy_)
      tell_status(now);
    report(now);
  }
}

bool Server::is_for_us(const takt_remote_Observation& message, MonoTime now) {
  if (message.config_hash == robot_.hash && message.policy_hash == policy_hash_) return true;
  other_files_at_ = now;
  other_robot_.say(
      now, fmt::format("observations of robot {} come that are not answered: its {} there; use the same", robot_.robot,
                       message.config_hash != robot_.hash ? "robot file differs from this one"
                                                          : "policy.file differs from this one"));
  return false;
}

// A bridge that was started again is another sender, and its predecessor is silent.
bool Server::is_of_our_bridge(const PeerId& sender, MonoTime now) {
  if (sender != bridge_ && bridge_.is_known() && now - bridge_heard_ <= robot_.freshness.max_age) {
    ++of_others_;
    other_bridge_.say(now, fmt::format("two processes show observations of robot {}: {} is answered, {} is not; "
                                       "give each robot a server and a name of its own",
                                       robot_.robot, text_of(bridge_), text_of(sender)));
    return false;
  }
  if (sender != bridge_) epoch_ = 0;
  bridge_ = sender;
  bridge_heard_ = now;
  return true;
}

// Ids go on as on the robot, gaps included, and jump where its session is another.
std::uint64_t Server::id_here(const takt_remote_Observation& message) {
  if (message.epoch != epoch_) {
    epoch_ = message.epoch;
    spdlog::info("robot {} begins a session ({})", robot_.robot, text_of(bridge_));
    return newest_id_ + kForget;
  }
  return newest_id_ + (message.id - newest_robot_id_);
}

void Server::take_observation(const takt_remote_Observation& message, const PeerId& sender) {
  const MonoTime now = monotonic_now();
  if (!is_sound(message, robot_.joints.size()) || !is_for_us(message, now) || !is_of_our_bridge(sender, now)) return;
  if (message.epoch == epoch_ && message.id <= newest_robot_id_) return;  // overtaken on its way
  if (!samples_.pass_on(message, sender, now)) {
    ++incomplete_;
    incomplete_at_ = now;
    return;
  }
  show(message, now);
}

void Server::show(const takt_remote_Observation& message, MonoTime arrived_at) {
  Observation observation = observation_of(message, arrived_at);
  observation.id = id_here(message);
  newest_id_ = observation.id;
  newest_robot_id_ = message.id;
  const Sent& followed = sent_[message.following_number % sent_.size()];
  if (message.following_server == number_ && followed.sequence == message.following_number &&
      followed.session == seat_->session()) {
    observation.command_sequence = followed.policy_sequence;
    observation.committed_from = message.committed_from;
    observation.committed_count = message.committed_count;
  }
  arrived_[observation.id % arrived_.size()] = {observation.id, message.epoch, message.id, arrived_at,
                                                oldest(observation.oldest_sensed_at, samples_.oldest_sensed_at())};
  seat_->publish(observation);
  unanswered_since_ = shown_at_ = arrived_at;
  ++shown_;
}

void Server::answer() {
  const CommandHeader& header = chunk_.header;
  const Arrived& answered = arrived_[header.observation_id % arrived_.size()];
  if (header.observation_id == 0 || answered.id != header.observation_id) return;
  if (answered.id == newest_id_) unanswered_since_ = {};
  const std::uint64_t sequence = ++sequence_;
  sent_[sequence % sent_.size()] = {sequence, seat_->session(), header.sequence};
  takt_remote_Command message{};
  message.server = number_;
  name_.copy(message.name, sizeof message.name - 1);
  seat_->source_of(header.sequence).copy(message.source, sizeof message.source - 1);
  message.epoch = answered.epoch;
  message.config_hash = robot_.hash;
  message.policy_hash = header.policy_hash;
  message.observation_id = answered.robot_id;
  message.number = sequence;
  message.queued_ns = (header.infer_started_at - answered.at).ns;
  message.inferred_ns = (header.infer_ended_at - header.infer_started_at).ns;
  if (header.outside_sensed_at.is_set())
    message.older_ns = std::max<std::int64_t>((answered.oldest_shown_at - header.outside_sensed_at).ns, 0);
  message.dropped = header.dropped_observations;
  message.step_period_ns = header.step_period.ns;
  message.step_count = header.step_count;
  message.joint_count = header.joint_count;
  message.fields = header.fields;
  refer(message.values, chunk_.values, chunk_.value_count());
  if (dds_write(commands_, &message) == DDS_RETCODE_OK) ++answered_;
}

void Server::tell_status(MonoTime now) {
  const auto is_recent = [now](MonoTime at) { return at.is_set() && now - at <= seconds(1); };
  status_told_ = now;
  told_of_policy_ = seat_->is_taken();
  takt_remote_ServerStatus message{};
  message.server = number_;
  name_.copy(message.name, sizeof message.name - 1);
  address_.copy(message.address, sizeof message.address - 1);
  message.has_policy = told_of_policy_;
  seat_->problem().copy(message.problem, sizeof message.problem - 1);
  message.epoch = epoch_;
  message.shown_age_ns = shown_at_.is_set() ? (now - shown_at_).ns : -1;
  message.lacks_samples = is_recent(incomplete_at_);
  message.has_other_files = is_recent(other_files_at_);
  dds_write(status_, &message);
}

void Server::report(MonoTime now) {
  if (now - reported_ < kServerReportPeriod) return;
  reported_ = now;
  spdlog::info("{} observations shown, {} answers sent; {} observations came without their samples{}", shown_,
               answered_, incomplete_,
               of_others_ == 0 ? "" : fmt::format("; {} of another bridge were ignored", of_others_));
  shown_ = answered_ = incomplete_ = of_others_ = 0;
}

}  // namespace takt::policy_host::remote
