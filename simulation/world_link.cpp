// SPDX-License-Identifier: Apache-2.0
#include "simulation/world_link.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "config/printable.hpp"
#include "executive/contract/joints.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/unix_socket.hpp"

namespace takt::simulation {
namespace {

static_assert(TAKT_WORLD_MAX_JOINTS == kMaxJoints && TAKT_WORLD_MAX_VALUES <= kMaxSensorValues);
static_assert(sizeof(takt_world_header) == 16 && sizeof(takt_world_hello) == 4840 && sizeof(takt_world_welcome) == 928);
static_assert(sizeof(takt_world_reset) == 536 && sizeof(takt_world_step) == 1600 && sizeof(takt_world_state) == 1872);
static_assert(sizeof(takt_world_camera) == 80 && sizeof(takt_world_image) == 24);
static_assert(sizeof(takt_world_step) <= TAKT_WORLD_ANSWER_OFFSET &&
              TAKT_WORLD_ANSWER_OFFSET + sizeof(takt_world_state) <= TAKT_WORLD_IMAGES_OFFSET &&
              TAKT_WORLD_IMAGES_OFFSET + TAKT_WORLD_MAX_CAMERAS * sizeof(takt_world_image) <= TAKT_WORLD_MEMORY_BYTES);
static_assert(std::endian::native == std::endian::little);

// What no joint does: beyond it, an answer is no state of a robot.
constexpr double kMostTurns = 1e6, kMostSpeed = 1e5;  // rad, rad/s
constexpr Duration kCallAgain = milliseconds(10);
constexpr std::size_t kImageAlignment = 64;

constexpr std::byte kRing{1};  // over shared memory the socket carries one byte for each message

// Rounded up: a poll that ends too early would be asked again without a pause.
int milliseconds_until(MonoTime deadline) {
  const std::int64_t left = (deadline - monotonic_now()).ns;
  return left <= 0 ? 0 : static_cast<int>((left + 999'999) / 1'000'000);
}

template <class Message>
std::span<const std::byte> bytes_of(const Message& message) {
  return std::as_bytes(std::span(&message, 1));
}
template <class Message>
std::span<std::byte> room_of(Message& message) {
  return std::as_writable_bytes(std::span(&message, 1));
}

// Of a text that may lack its end, without what would garble a line.
template <std::size_t kBytes>
std::string text_of(const char (&text)[kBytes]) {
  std::string line(text, strnlen(text, kBytes));
  std::ranges::replace_if(
      line, [](unsigned char c) { return c < 0x20 || c == 0x7F; }, '?');
  return config::printable(line);
}

bool all_within(std::span<const double> values, double most) {
  return std::ranges::all_of(values, [most](double value) { return std::abs(value) <= most; });  // not of NaN
}

bool is_rotation(const double (&q)[4]) {
  const double square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  return std::abs(square - 1) < 1e-3;
}

std::string mismatch(const takt_world_header& question, const takt_world_header& answer, std::uint16_t kind,
                     std::size_t bytes) {
  if (answer.protocol != TAKT_WORLD_PROTOCOL)
    return fmt::format("speaks protocol {}, Takt {}", answer.protocol, TAKT_WORLD_PROTOCOL);
  if (answer.kind != kind || answer.bytes != bytes)
    return fmt::format("message of kind {} with {} bytes, expected kind {} with {}", answer.kind, answer.bytes, kind,
                       bytes);
  if (answer.sequence != question.sequence)
    return fmt::format("answers question {}, asked was {}", answer.sequence, question.sequence);
  return {};
}

}  // namespace

std::string_view name(WorldEndKind kind) {
  switch (kind) {
    case WorldEndKind::absent:
      return "absent";
    case WorldEndKind::refused:
      return "refused";
    case WorldEndKind::hung:
      return "hung";
    case WorldEndKind::died:
      return "died";
    case WorldEndKind::invalid_answer:
      return "nonsense";
    case WorldEndKind::unable:
      return "unable";
    case WorldEndKind::failed:
      return "failed";
    case WorldEndKind::succeeded:
      return "succeeded";
  }
  return "invalid";
}

WorldLink::WorldLink(std::string path, const Robot& robot, const Patience& patience)
    : path_(std::move(path)), patience_(patience), joint_count_(robot.joints.size()), step_(robot.step) {
  for (const WorldCamera& camera : robot.cameras) cameras_.push_back({.declared = camera});
}

WorldEnd WorldLink::end(WorldEndKind kind, const std::string& what) const {
  return {kind, fmt::format("world {}{}: {}", path_, name_.empty() ? "" : " (" + name_ + ")", what)};
}

std::expected<WorldLink, WorldEnd> WorldLink::connect(const std::string& path, const Robot& robot,
                                                      const Patience& patience) {
  WorldLink link(path, robot, patience);
  const MonoTime deadline = monotonic_now() + patience.greeting;
  if (auto called = link.call_on(deadline); !called) return std::unexpected(called.error());
  if (auto greeted = link.greet(robot, deadline); !greeted) return std::unexpected(greeted.error());
  return link;
}

std::expected<void, WorldEnd> WorldLink::call_on(MonoTime deadline) {
  if (path_.empty() || path_.size() >= sizeof(sockaddr_un::sun_path))
    return std::unexpected(end(WorldEndKind::absent, "no path of a Unix socket; choose one of 1 to 107 bytes"));
  while (true) {
    socket_ = ipc::Descriptor(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    if (socket_.is_open() && ipc::connect_to(socket_, path_)) return {};
    const bool may_come = errno == ENOENT || errno == ECONNREFUSED || errno == EAGAIN || errno == EINTR;
    if (!may_come || monotonic_now() >= deadline)
      return std::unexpected(
          end(WorldEndKind::absent, "no process to connect to (" + ipc::errno_text() + "); start the world first"));
    sleep_until(monotonic_now() + kCallAgain);
  }
}

takt_world_header WorldLink::next_header(std::uint16_t kind, std::size_t bytes) {
  return {static_cast<std::uint32_t>(bytes), kind, TAKT_WORLD_PROTOCOL, ++sequence_};
}

std::expected<void, WorldEnd> WorldLink::greet(const Robot& robot, MonoTime deadline) {
  std::size_t bytes = TAKT_WORLD_MEMORY_BYTES;
  for (CameraPlace& camera : cameras_) {
    camera.offset = bytes;
    bytes += (camera.declared.shape.bytes() + kImageAlignment - 1) / kImageAlignment * kImageAlignment;
  }
  auto memory = ipc::Segment::create("takt-world", bytes, true);
  if (!memory) return std::unexpected(end(WorldEndKind::absent, memory.error()));
  memory_ = std::move(*memory);

  takt_world_hello hello{};
  hello.header = next_header(TAKT_WORLD_HELLO, sizeof hello);
  hello.step_ns = static_cast<std::uint64_t>(step_.ns);
  hello.joint_count = static_cast<std::uint32_t>(joint_count_);
  robot.name.copy(hello.robot, sizeof hello.robot - 1);
  for (std::size_t joint = 0; joint < joint_count_; ++joint)
    robot.joints[joint].copy(hello.joints[joint], sizeof hello.joints[joint] - 1);
  hello.memory_bytes = bytes;
  for (const CameraPlace& camera : cameras_) {
    const auto& [height, width, channels] = camera.declared.shape;
    takt_world_camera& said = hello.cameras[hello.camera_count++];
    camera.declared.name.copy(said.name, sizeof said.name - 1);
    said.height = height;
    said.width = width;
    said.channels = channels;
    said.offset = static_cast<std::uint32_t>(camera.offset);
  }
  const std::array files{memory_->fd()};
  if (auto ended = send(bytes_of(hello), files)) return std::unexpected(*ended);

  takt_world_welcome welcome{};
  if (auto ended = receive_by_socket(room_of(welcome), deadline)) return std::unexpected(*ended);
  name_ = text_of(welcome.world);
  if (const auto why = mismatch(hello.header, welcome.header, TAKT_WORLD_WELCOME, sizeof welcome); !why.empty())
    return std::unexpected(end(WorldEndKind::invalid_answer, why));
  if (welcome.refusal[0] != '\0') return std::unexpected(end(WorldEndKind::refused, text_of(welcome.refusal)));
  gives_ = welcome.gives;
  sensor_ = text_of(welcome.sensor);
  sensor_count_ = sensor_.empty() ? 0 : welcome.sensor_count;
  if (!sensor_.empty() && (sensor_count_ < 1 || sensor_count_ > TAKT_WORLD_MAX_VALUES))
    return std::unexpected(
        end(WorldEndKind::invalid_answer,
            fmt::format("sensor {} of {} values; it has from 1 to {}", sensor_, sensor_count_, TAKT_WORLD_MAX_VALUES)));
  if (auto ended = accept_cameras(welcome)) return std::unexpected(*ended);
  return {};
}

std::optional<WorldEnd> WorldLink::accept_cameras(const takt_world_welcome& welcome) {
  if (welcome.camera_count > TAKT_WORLD_MAX_CAMERAS)
    return end(WorldEndKind::invalid_answer,
               fmt::format("{} cameras; it has at most {}", welcome.camera_count, TAKT_WORLD_MAX_CAMERAS));
  for (const takt_world_camera& said : std::span(welcome.cameras).first(welcome.camera_count)) {
    const std::string sensor = text_of(said.name);
    const auto found = std::ranges::find(cameras_, sensor, [](const CameraPlace& one) { return one.declared.name; });
    if (found == cameras_.end())
      return end(WorldEndKind::refused, fmt::format("the robot has no sensor {} of images", sensor));
    const auto& [height, width, channels] = found->declared.shape;
    if (said.height != height || said.width != width || said.channels != channels)
      return end(
          WorldEndKind::refused,
          fmt::format("images of sensor {} are {} x {} x {} here, {} x {} x {} in the robot file: make them equal",
                      sensor, said.height, said.width, said.channels, height, width, channels));
    found->is_played = true;
  }
  return {};
}

std::vector<std::size_t> WorldLink::cameras() const {
  std::vector<std::size_t> played;
  for (std::size_t camera = 0; camera < cameras_.size(); ++camera)
    if (cameras_[camera].is_played) played.push_back(camera);
  return played;
}

std::expected<takt_world_state, WorldEnd> WorldLink::reset(std::uint64_t seed, std::span<const double> q) {
  takt_world_reset question{};
  question.header = next_header(TAKT_WORLD_RESET, sizeof question);
  question.seed = seed;
  std::ranges::copy(q.first(joint_count_), question.q);
  time_ = {};
  seen_sample_ = 0;
  for (CameraPlace& camera : cameras_) camera.seen = 0;
  return ask(bytes_of(question));
}

std::expected<takt_world_state, WorldEnd> WorldLink::step(const Load& load) {
  takt_world_step question{};
  question.header = next_header(TAKT_WORLD_STEP, sizeof question);
  question.time_ns = static_cast<std::uint64_t>(time_.ns);
  question.step_ns = static_cast<std::uint64_t>(step_.ns);
  std::ranges::copy(load.torque.first(joint_count_), question.torque);
  std::ranges::copy(load.viscous.first(joint_count_), question.viscous);
  std::ranges::copy(load.coulomb.first(joint_count_), question.coulomb);
  question.hangs = load.hangs ? 1 : 0;
  std::ranges::copy(load.push, question.push);
  time_ = time_ + step_;
  return ask(bytes_of(question));
}

std::expected<takt_world_state, WorldEnd> WorldLink::ask(std::span<const std::byte> question) {
  if (ended_) return std::unexpected(*ended_);
  images_.clear();
  takt_world_header asked{};
  std::memcpy(&asked, question.data(), sizeof asked);
  const MonoTime deadline = monotonic_now() + patience_.answer;
  takt_world_state state{};
  ended_ = send(question, {});
  if (!ended_)
    ended_ = is_over_shared_memory() ? receive_by_memory(room_of(state), deadline)
                                     : receive_by_socket(room_of(state), deadline);
  if (!ended_) {
    const std::string why = mismatch(asked, state.header, TAKT_WORLD_STATE, sizeof state);
    ended_ = why.empty() ? judge(state) : end(WorldEndKind::invalid_answer, why);
  }
  if (!ended_ && state.image_count != 0) ended_ = take_images(state, deadline);
  if (ended_) return std::unexpected(*ended_);
  seen_sample_ = state.sensor_sequence;
  return state;
}

std::optional<WorldEnd> WorldLink::send(std::span<const std::byte> question, std::span<const int> files) {
  bool taken = false;
  if (is_over_shared_memory()) {
    std::ranges::copy(question, memory_->writable().begin());
    taken = ::send(socket_.get(), &kRing, 1, MSG_DONTWAIT | MSG_NOSIGNAL) == 1;
  } else {
    // The world reads every question before it is asked the next: there is room.
    taken = ipc::send_message(socket_.get(), question, files);
  }
  if (taken) return {};
  if (errno == EPIPE || errno == ECONNRESET) return went_away();
  return end(WorldEndKind::died, "takes no message (" + ipc::errno_text() + ")");
}

// Seen when it is asked or when its answer is waited for: the kernel decides which, the sentence is the same.
WorldEnd WorldLink::went_away() const {
  return end(WorldEndKind::died, fmt::format("went away before it answered question {}", sequence_));
}

std::optional<WorldEnd> WorldLink::receive_by_socket(std::span<std::byte> into, MonoTime deadline) {
  for (std::size_t got = 0; got < into.size();) {
    pollfd wait{socket_.get(), POLLIN, 0};
    if (::poll(&wait, 1, milliseconds_until(deadline)) == 0)
      return end(WorldEndKind::hung, fmt::format("no answer to question {} in time", sequence_));
    const ssize_t size = recv(socket_.get(), into.data() + got, into.size() - got, MSG_DONTWAIT);
    if (size < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (size <= 0) return went_away();
    got += static_cast<std::size_t>(size);
  }
  return {};
}

std::optional<WorldEnd> WorldLink::receive_by_memory(std::span<std::byte> into, MonoTime deadline) {
  std::byte ring{};
  if (auto ended = receive_by_socket({&ring, 1}, deadline)) return ended;
  std::ranges::copy(memory_->readable().subspan(TAKT_WORLD_ANSWER_OFFSET, into.size()), into.begin());
  return {};
}

std::optional<WorldEnd> WorldLink::judge(const takt_world_state& state) const {
  if (state.outcome != TAKT_WORLD_RUNNING) return judge_outcome(state);
  const auto invalid = [this](const std::string& what) { return end(WorldEndKind::invalid_answer, what); };
  if (state.time_ns != static_cast<std::uint64_t>(time_.ns))
    return invalid(fmt::format("state of {} ns, expected {} ns", state.time_ns, time_.ns));
  for (std::size_t joint = 0; joint < joint_count_; ++joint)
    if (!all_within({&state.q[joint], 1}, kMostTurns) || !all_within({&state.dq[joint], 1}, kMostSpeed))
      return invalid(fmt::format("joint {} at {} rad with {} rad/s", joint, state.q[joint], state.dq[joint]));
  if (gives(TAKT_WORLD_POINT) && !all_within(state.point, kMostTurns)) return invalid("controlled point is no place");
  if (gives(TAKT_WORLD_BASE) && !all_within(state.base_position, kMostTurns)) return invalid("the base is no place");
  if (gives(TAKT_WORLD_BASE) && !is_rotation(state.base_orientation))
    return invalid("the base's orientation is no rotation: its length is not 1");
  if (gives(TAKT_WORLD_ERROR) && !(state.error >= 0 && state.error <= kMostTurns))
    return invalid(fmt::format("the task's error is {}", state.error));
  if (const std::string why = sensor_problem(state); !why.empty()) return invalid(why);
  if (!gives(TAKT_WORLD_IMU)) return {};
  if (!is_rotation(state.orientation)) return invalid("the IMU's orientation is no rotation: its length is not 1");
  if (!all_within(state.angular_velocity, kMostSpeed) || !all_within(state.acceleration, kMostTurns))
    return invalid("the IMU's angular velocity or acceleration is none that a robot has");
  return {};
}

std::string WorldLink::sensor_problem(const takt_world_state& state) const {
  if (sensor_.empty() || (state.sensor_sequence == 0 && seen_sample_ == 0)) return {};
  if (state.sensor_sequence < seen_sample_ || state.sensor_sequence > seen_sample_ + 1)
    return fmt::format("sample {} of sensor {} after {}", state.sensor_sequence, sensor_, seen_sample_);
  for (const double value : std::span(state.sensor).first(sensor_count_))
    if (!(std::abs(value) <= std::numeric_limits<float>::max()))
      return fmt::format("sensor {} says {}", sensor_, value);
  return {};
}

// What heads an image is copied and judged before any of its bytes is; those can be none that an image has not.
std::optional<WorldEnd> WorldLink::take_images(const takt_world_state& state, MonoTime deadline) {
  if (state.image_count > cameras_.size())
    return end(WorldEndKind::invalid_answer, fmt::format("{} images with one state", state.image_count));
  for (std::size_t i = 0; i < state.image_count; ++i) {
    takt_world_image image{};
    if (is_over_shared_memory())
      std::ranges::copy(memory_->readable().subspan(TAKT_WORLD_IMAGES_OFFSET + i * sizeof image, sizeof image),
                        room_of(image).begin());
    else if (auto ended = receive_by_socket(room_of(image), deadline))
      return ended;
    if (const std::string why = image_problem(image, time_); !why.empty())
      return end(WorldEndKind::invalid_answer, why);
    WorldImage& taken = images_.emplace_back(
        WorldImage{image.camera, image.sequence, {static_cast<std::int64_t>(image.time_ns)}, nullptr});
    cameras_[image.camera].seen = taken.sequence;
    cameras_[image.camera].sensed_at = taken.sensed_at;
    if (auto ended = receive_pixels(image.camera, deadline, taken.pixels)) return ended;
  }
  return {};
}

std::string WorldLink::image_problem(const takt_world_image& image, Duration now) const {
  if (image.camera >= cameras_.size() || !cameras_[image.camera].is_played)
    return fmt::format("an image of camera {}, which it does not play", image.camera);
  const CameraPlace& camera = cameras_[image.camera];
  const std::string& sensor = camera.declared.name;
  if (image.bytes != camera.declared.shape.bytes())
    return fmt::format("an image of {} bytes of sensor {}, expected {}", image.bytes, sensor,
                       camera.declared.shape.bytes());
  const bool again = std::ranges::find(images_, image.camera, &WorldImage::camera) != images_.end();
  if (again || image.sequence != camera.seen + 1)
    return fmt::format("image {} of sensor {} after {}{}", image.sequence, sensor, camera.seen,
                       again ? " with the same state" : "");
  if (image.time_ns > static_cast<std::uint64_t>(now.ns))
    return fmt::format("an image of sensor {} sensed at {} ns, after the state's {} ns", sensor, image.time_ns, now.ns);
  if (camera.seen != 0 && image.time_ns <= static_cast<std::uint64_t>(camera.sensed_at.ns))
    return fmt::format("an image of sensor {} sensed at {} ns, the one before at {} ns", sensor, image.time_ns,
                       camera.sensed_at.ns);
  return {};
}

// One copy: out of the world's memory, or off the socket.
std::optional<WorldEnd> WorldLink::receive_pixels(std::size_t camera, MonoTime deadline, Pixels& pixels) {
  const std::size_t bytes = cameras_[camera].declared.shape.bytes();
  if (is_over_shared_memory()) {
    const auto place = memory_->readable().subspan(cameras_[camera].offset, bytes);
    const auto* const first = reinterpret_cast<const std::uint8_t*>(place.data());
    pixels = std::make_shared<const std::vector<std::uint8_t>>(first, first + bytes);
    return {};
  }
  auto received = std::make_shared<std::vector<std::uint8_t>>(bytes);
  auto ended = receive_by_socket(std::as_writable_bytes(std::span(*received)), deadline);
  pixels = std::move(received);
  return ended;
}

std::optional<WorldEnd> WorldLink::judge_outcome(const takt_world_state& state) const {
  const std::string reason = text_of(state.reason);
  switch (state.outcome) {
    case TAKT_WORLD_SUCCEEDED:
      return end(WorldEndKind::succeeded, "the task is done" + (reason.empty() ? "" : ": " + reason));
    case TAKT_WORLD_FAILED:
      return end(WorldEndKind::failed, "the task is beyond help" + (reason.empty() ? "" : ": " + reason));
    case TAKT_WORLD_UNABLE:
      return end(WorldEndKind::unable, "cannot go on" + (reason.empty() ? "" : ": " + reason));
    default:
      return end(WorldEndKind::invalid_answer, fmt::format("outcome {} is none", state.outcome));
  }
}

}  // namespace takt::simulation
