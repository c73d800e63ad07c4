// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/policy_process.hpp"

#include <fmt/format.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include "config/paths.hpp"
#include "evidence/rollout/robot_copy.hpp"
#include "executive/contract/image_sample.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::evidence {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kGreet{10};
constexpr Duration kLook = microseconds(20);
constexpr Duration kServe = milliseconds(20);  // who comes and goes, while an answer is waited for

}  // namespace

PolicyProcess::PolicyProcess(std::string command, policy_host::Grants grants)
    : PolicyProcess(std::move(command), Patience{}, std::move(grants)) {}

PolicyProcess::PolicyProcess(std::string command, const Patience& patience, policy_host::Grants grants)
    : command_(std::move(command)), patience_(patience), grants_(std::move(grants)) {
  // A file's name, as `takt run` takes it, need not look like a path to the shell.
  if (fs::is_regular_file(command_)) command_ = "'" + fs::absolute(command_).lexically_normal().string() + "'";
}

PolicyProcess::~PolicyProcess() {
  end();
}

bool PolicyProcess::is_ours() const {
  return owner_ == ::getpid();
}

// A forked copy's seat and sensors are its parent's: their sockets, and their threads, which are not here.
void PolicyProcess::disown() {
  for (Source& source : sources_) (void)source.server.release();
  (void)seat_.release();
  sources_.clear();
}

void PolicyProcess::end() {
  process_.end();
  if (!is_ours()) return disown();
  sources_.clear();
  seat_.reset();
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
  owner_ = 0;
}

std::expected<void, std::string> PolicyProcess::prepare() {
  disown();
  std::string pattern = (fs::temp_directory_path() / "takt-policy.XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) return std::unexpected("no folder for its seat: " + ipc::errno_text());
  folder_ = pattern;
  owner_ = ::getpid();
  if (auto written = write_robot(*robot_, folder_); !written) return written;
  auto seat = policy_host::PolicySeat::open(
      *robot_, policy_hash_,
      {.runtime_directory = folder_, .server = "a rollout in virtual time", .policy_user = {}, .lockstep = true});
  if (!seat) return std::unexpected(seat.error());
  seat_ = std::move(*seat);
  for (const std::size_t sensor : policy_host::sensors_in_use(*robot_)) {
    auto server = ipc::SensorServer::start(config::sensor_socket(folder_, robot_->sensors[sensor].name), {},
                                           policy_host::mailbox_of(robot_->sensors[sensor]));
    if (!server) return std::unexpected(server.error());
    sources_.push_back({sensor, std::move(*server), {}});
  }
  return {};
}

std::expected<void, std::string> PolicyProcess::start() {
  grants_.runtime_directory = folder_;
  const auto confine = [this] {
    for (const std::string& gap : policy_host::go_behind_boundary(grants_))
      fmt::print(stderr, "warning: policy `{}`: {}\n", command_, gap);
    std::fflush(stderr);
  };
  const std::string command = fmt::format("{} --robot '{}/robot.yaml' --runtime-dir '{}'", command_, folder_, folder_);
  if (auto started = process_.start(command, confine); !started) return started;
  return wait_for_policy(seat_->session());
}

std::expected<void, std::string> PolicyProcess::wait_for_policy(std::uint64_t session_before) {
  for (const MonoTime deadline = monotonic_now() + patience_.start; seat_->session() == session_before;) {
    seat_->serve(kGreet);
    if (const auto code = process_.ended())
      return std::unexpected(
          fmt::format("exited with {} before it took the policy's place; what it said is above", *code));
    if (monotonic_now() < deadline) continue;
    process_.end();
    return std::unexpected(fmt::format("did not take the policy's place within {:.0f} s", patience_.start.seconds()));
  }
  return {};
}

std::expected<void, std::string> PolicyProcess::begin(const config::RobotConfig& robot, std::uint64_t policy_hash) {
  robot_ = &robot;
  policy_hash_ = policy_hash;
  return begin_session(false);
}

std::expected<void, std::string> PolicyProcess::begin_anew() {
  return begin_session(true);
}

std::expected<void, std::string> PolicyProcess::begin_session(bool anew) {
  const auto begun = is_ours() ? std::expected<void, std::string>{} : prepare();
  const auto seated = begun ? take_seat(anew) : begun;
  silence_ = seated ? "" : fmt::format("policy `{}`: {}", command_, seated.error());
  if (seated) return {};
  end();
  return std::unexpected(silence_);
}

std::expected<void, std::string> PolicyProcess::take_seat(bool anew) {
  for (Source& source : sources_) source.shown = {};
  seat_->publish({});  // what the mailbox holds is of another session
  if (!anew && process_.is_kept() && !process_.ended()) {
    const std::uint64_t session = seat_->session();
    seat_->evict();
    if (wait_for_policy(session)) return {};
  }
  process_.end();
  return start();
}

void PolicyProcess::show(Source& source, const SensorSample& sample, std::span<const std::uint8_t> image) {
  if (sample.sequence == source.shown.sequence && sample.sensed_at == source.shown.sensed_at) return;
  source.shown = sample;
  if (!robot_->sensors[source.sensor].image) return source.server->publish(sample);
  const std::span<std::byte> slot = source.server->begin();
  const ImageHeader header{sample.sequence, sample.sensed_at, sample.published_at,
                           static_cast<std::uint32_t>(image.size()), 0};
  std::memcpy(slot.data(), &header, sizeof header);
  std::ranges::copy(std::as_bytes(image), slot.subspan(sizeof header).begin());
  source.server->commit(sizeof header + image.size());
}

void PolicyProcess::fall_silent(const std::string& why) {
  process_.end();
  silence_ = fmt::format("policy `{}` {}", command_, why);
}

bool PolicyProcess::answer(const Observation& observation, std::span<const SensorSample> samples,
                           std::span<const std::span<const std::uint8_t>> images, CommandChunk& chunk) {
  if (!silence_.empty()) return false;
  for (Source& source : sources_) show(source, samples[source.sensor], images[source.sensor]);
  seat_->publish(observation);
  const MonoTime deadline = monotonic_now() + patience_.answer;
  for (MonoTime serve = monotonic_now() + kServe; !seat_->read(chunk) || chunk.header.observation_id != observation.id;
       sleep_until(monotonic_now() + kLook)) {
    const MonoTime now = monotonic_now();
    if (now < serve) continue;
    serve = now + kServe;
    seat_->serve();
    if (const auto code = process_.ended()) {
      fall_silent(fmt::format("exited with {} in the middle of a rollout; what it said is above", *code));
      return false;
    }
    if (now > deadline) {
      fall_silent(fmt::format("did not answer an observation within {:.0f} s", patience_.answer.seconds()));
      return false;
    }
  }
  return chunk.header.step_count != 0;
}

}  // namespace takt::evidence
