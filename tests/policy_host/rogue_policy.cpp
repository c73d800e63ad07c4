// SPDX-License-Identifier: Apache-2.0
// takt-rogue-policy: attaches like a policy host, holds the robot still for a while, then misbehaves in one named way
// until it is killed or the executive ends the session. For tests only, never installed.
// Exit codes: 0 session ended, 64 usage, 65 configuration refused, 69 the executive refused it or is not there.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <limits>
#include <random>
#include <string>
#include <utility>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/ipc/ring_layout.hpp"
#include "policy_host/executive_link.hpp"
#include "policy_host/pacing.hpp"

namespace takt::policy_host {
namespace {

constexpr int kExitUsage = 64;
constexpr int kExitUnavailable = 69;

enum class Lie : std::uint8_t {
  nan,
  inf,
  wrong_shape,
  old_observation,
  future_observation,
  repeated_sequence,
  random_bytes,  // keeps filling its whole mapped mailbox
  out_of_range,
  wrong_policy,
  backward_stamps,
  frozen,  // says nothing any more
  torn,    // dies by SIGKILL between two words of a publication
  flood,   // one message after the other, as long as the mailbox takes, or legal but for its values
};
constexpr std::array<std::pair<const char*, Lie>, 13> kLies{{{"nan", Lie::nan},
                                                             {"inf", Lie::inf},
                                                             {"wrong_shape", Lie::wrong_shape},
                                                             {"old_observation", Lie::old_observation},
                                                             {"future_observation", Lie::future_observation},
                                                             {"repeated_sequence", Lie::repeated_sequence},
                                                             {"random_bytes", Lie::random_bytes},
                                                             {"out_of_range", Lie::out_of_range},
                                                             {"wrong_policy", Lie::wrong_policy},
                                                             {"backward_stamps", Lie::backward_stamps},
                                                             {"frozen", Lie::frozen},
                                                             {"torn", Lie::torn},
                                                             {"flood", Lie::flood}}};

// The executive's two mailboxes, held by hand: a liar needs the bare memory.
struct Mailboxes {
  ipc::Lease lease;
  ipc::Segment observations;
  ipc::Segment commands;
  ipc::SlotReader reader;
  ipc::SlotWriter writer;
};

std::expected<Mailboxes, std::string> attach(const std::string& socket, const Hello& hello) {
  auto lease = ipc::attach(socket, hello, std::chrono::milliseconds(500));
  if (!lease) return std::unexpected(lease.error());
  auto observations = ipc::Segment::adopt_read_only(lease->descriptors[ipc::kObservationDescriptor].release(),
                                                    ipc::ring_bytes(ipc::observation_mailbox()));
  if (!observations) return std::unexpected(observations.error());
  auto commands = ipc::Segment::adopt_writable(lease->descriptors[ipc::kCommandDescriptor].release(),
                                               ipc::ring_bytes(ipc::command_mailbox()));
  if (!commands) return std::unexpected(commands.error());
  auto reader = ipc::SlotReader::attach(observations->readable(), ipc::observation_mailbox());
  if (!reader) return std::unexpected(reader.error());
  ipc::SlotWriter writer(commands->writable(), ipc::command_mailbox());
  if (auto done = ipc::acknowledge(*lease); !done) return std::unexpected(done.error());
  return Mailboxes{std::move(*lease), std::move(*observations), std::move(*commands), std::move(*reader), writer};
}

// The executive may still be starting.
std::expected<Mailboxes, std::string> attach_within(Duration patience, const std::string& socket, const Hello& hello) {
  const MonoTime give_up = monotonic_now() + patience;
  for (;;) {
    auto mailboxes = attach(socket, hello);
    if (mailboxes || monotonic_now() > give_up) return mailboxes;
    sleep_until(monotonic_now() + milliseconds(100));
  }
}

class Rogue {
 public:
  Rogue(const config::RobotConfig& robot, std::uint64_t policy_hash, Mailboxes mailboxes, Lie lie)
      : robot_(robot), policy_hash_(policy_hash), mailboxes_(std::move(mailboxes)), lie_(lie) {
    chunk_.header.step_period = robot.policy->step_period;
    chunk_.header.step_count = static_cast<std::uint16_t>(robot.policy->steps);
    chunk_.header.joint_count = static_cast<std::uint16_t>(robot.joints.size());
    chunk_.header.fields = static_cast<std::uint8_t>(CommandField::q);
  }

  // Returns when the executive ended the session.
  void run(Duration healthy_for) {
    const MonoTime honest_until = monotonic_now() + healthy_for;
    MonoTime published_at;
    bool looked = false;
    while (!ipc::is_over(mailboxes_.lease)) {
      const bool lying = monotonic_now() > honest_until;
      if (lying && lie_ == Lie::random_bytes) {
        scribble();
        sleep_until(monotonic_now() + microseconds(100));
        continue;
      }
      if (lying && lie_ == Lie::flood) {
        flood();
        sleep_until(monotonic_now() + microseconds(200));
        continue;
      }
      sleep_until(next_look(monotonic_now(), published_at, robot_.policy->period, looked));
      Observation observation;
      looked = mailboxes_.reader.read_latest(std::as_writable_bytes(std::span(&observation, 1))).status !=
               ipc::ReadStatus::fresh;
      if (looked) continue;
      published_at = observation.published_at;
      hold_position(observation);
      if (lying && !misbehave(observation)) continue;
      mailboxes_.writer.publish(std::as_bytes(std::span(&chunk_, 1)).first(chunk_.used_bytes()));
    }
  }

 private:
  void hold_position(const Observation& observation) {
    if (observation.mode <= static_cast<std::uint8_t>(Mode::arming)) {
      for (std::size_t joint = 0; joint < robot_.joints.size(); ++joint) {
        const config::Limits& limits = robot_.joints[joint].limits;
        held_[joint] = std::clamp(observation.q[joint], static_cast<float>(limits.q_min + limits.position_margin),
                                  static_cast<float>(limits.q_max - limits.position_margin));
      }
    }
    CommandHeader& header = chunk_.header;
    header.step_count = static_cast<std::uint16_t>(robot_.policy->steps);
    for (std::size_t step = 0; step < header.step_count; ++step) {
      std::copy_n(held_.at.begin(), header.joint_count, &chunk_.values[value_index(header, CommandField::q, step, 0)]);
    }
    header.policy_hash = policy_hash_;
    header.observation_id = observation.id;
    ++header.sequence;
    header.outside_sensed_at = observation.published_at;
    header.dequeued_at = header.infer_started_at = header.infer_ended_at = header.published_at = monotonic_now();
  }

  // Spoils the honest chunk. False: nothing is to be published.
  bool misbehave(const Observation& observation) {
    CommandHeader& header = chunk_.header;
    switch (lie_) {
      case Lie::nan:
        chunk_.values[0] = std::numeric_limits<float>::quiet_NaN();
        return true;
      case Lie::inf:
        chunk_.values[chunk_.value_count() - 1] = std::numeric_limits<float>::infinity();
        return true;
      case Lie::wrong_shape:
        header.step_count = 0;
        return true;
      case Lie::old_observation:
        // A second old: forgotten, or at least beyond any sensible max_age.
        header.observation_id = observation.id > 50 ? observation.id - 50 : 1;
        return true;
      case Lie::future_observation:
        header.observation_id = observation.id + 1000;
        return true;
      case Lie::repeated_sequence:
        --header.sequence;
        return true;
      case Lie::out_of_range:
        std::fill_n(chunk_.values, chunk_.value_count(), 100.0F);
        return true;
      case Lie::wrong_policy:
        header.policy_hash ^= 1;
        return true;
      case Lie::backward_stamps:
        header.infer_ended_at = header.infer_started_at - seconds(1);
        return true;
      case Lie::torn:
        die_in_mid_publish();
      case Lie::random_bytes:
      case Lie::frozen:
      case Lie::flood:
        return false;
    }
    return false;
  }

  void scribble() {
    const std::span<std::byte> memory = mailboxes_.commands.writable();
    for (std::size_t at = 0; at + 8 <= memory.size(); at += 8) {
      ipc::shared_at<ipc::Word>(memory.data() + at).store(random_(), std::memory_order_relaxed);
    }
  }

  void flood() {
    Observation observation;  // the newest, for answers to forgotten ones are refused before their values are read
    if (mailboxes_.reader.read_latest(std::as_writable_bytes(std::span(&observation, 1))).status ==
        ipc::ReadStatus::fresh)
      chunk_.header.observation_id = observation.id;
    ++chunk_.header.sequence;
    const bool is_legal_in_size = random_() % 2 == 0;  // by turns it may fall in step with the reader's period
    // Velocities would be refused for their shape where targets are joined linearly.
    chunk_.header.fields = kAllCommandFields & ~static_cast<std::uint8_t>(CommandField::dq);
    std::fill_n(chunk_.values, kMaxChunkValues, std::numeric_limits<float>::quiet_NaN());
    const auto whole = std::as_bytes(std::span(&chunk_, 1));
    mailboxes_.writer.publish(is_legal_in_size ? whole.first(chunk_.used_bytes()) : whole);
  }

  // The first half of a publication, as SlotWriter would do it, then the end of the process.
  [[noreturn]] void die_in_mid_publish() {
    const auto shape = ipc::command_mailbox();
    const std::uint64_t sequence = mailboxes_.writer.published() + 1;
    std::byte* const at = mailboxes_.commands.writable().data() + ipc::slot_offset(shape, sequence);
    auto& slot = ipc::shared_at<ipc::SlotHeader>(at);
    slot.version.store(ipc::version_while_writing(sequence), std::memory_order_relaxed);
    const auto payload = std::as_bytes(std::span(&chunk_, 1)).first(chunk_.used_bytes() / 2);
    std::ranges::copy(payload, at + sizeof(ipc::SlotHeader));
    kill(getpid(), SIGKILL);
    for (;;) pause();
  }

  const config::RobotConfig& robot_;
  std::uint64_t policy_hash_;
  Mailboxes mailboxes_;
  Lie lie_;
  Positions held_;
  CommandChunk chunk_;
  std::mt19937_64 random_{1};
};

// '2 s' or '300 ms'; negative: not understood.
Duration parse_duration(const std::string& text) {
  double value = 0;
  std::array<char, 4> unit{};
  if (std::sscanf(text.c_str(), "%lf %3s", &value, unit.data()) != 2) return seconds(-1);
  if (std::string_view(unit.data()) == "s") return nanoseconds(static_cast<std::int64_t>(value * 1e9));
  if (std::string_view(unit.data()) == "ms") return nanoseconds(static_cast<std::int64_t>(value * 1e6));
  return seconds(-1);
}

int serve(const std::string& robot_file, const std::string& runtime_directory, Lie lie, Duration healthy_for) {
  const auto robot = config::load(robot_file);
  if (!robot || !robot->policy) {
    fmt::print(stderr, "{}\n", robot ? robot_file + ": no policy section" : robot.error());
    return config::kExitBadConfiguration;
  }
  const auto hash = config::policy_hash(robot->policy->file);
  if (!hash) {
    fmt::print(stderr, "{}\n", hash.error());
    return config::kExitBadConfiguration;
  }
  auto mailboxes = attach_within(seconds(5), config::executive_socket(runtime_directory),
                                 hello_of(*robot, *hash, Role::policy, "takt-rogue-policy"));
  if (!mailboxes) {
    fmt::print(stderr, "{}\n", mailboxes.error());
    return kExitUnavailable;
  }
  Rogue(*robot, *hash, std::move(*mailboxes), lie).run(healthy_for);
  return 0;
}

}  // namespace
}  // namespace takt::policy_host

int main(int argc, char** argv) {
  using namespace takt::policy_host;
  CLI::App app{"Attaches like a policy host, behaves for a while, then misbehaves as told."};
  std::string robot_file, runtime_directory, behaviour, healthy_for = "2 s";
  app.add_option("--robot", robot_file, "robot file")->required();
  app.add_option("--runtime-dir", runtime_directory, "where the robot's sockets are")->required();
  app.add_option("--behaviour", behaviour, "how to misbehave")->required();
  app.add_option("--healthy-for", healthy_for, "how long to hold position first, such as '2 s'");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitUsage;
  }
  const auto lie = std::ranges::find(kLies, behaviour, [](const auto& named) { return std::string(named.first); });
  const takt::Duration duration = parse_duration(healthy_for);
  if (lie == kLies.end() || duration.ns < 0) {
    std::string names;
    for (const auto& named : kLies) names += std::string(" ") + named.first;
    fmt::print(stderr, "--behaviour is one of:{}; --healthy-for is a number with s or ms\n", names);
    return kExitUsage;
  }
  return serve(robot_file, runtime_directory, lie->second, duration);
}
