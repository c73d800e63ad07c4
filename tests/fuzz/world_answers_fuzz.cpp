// SPDX-License-Identifier: Apache-2.0
// Any answers of a world: the robot that it plays stays a robot, or the world's end is one sentence and for good.
// Method: a stranger behind the socket, or in the shared memory, whose sound answers the input spoils.
#include <sys/mman.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "simulation/outside_mechanics.hpp"
#include "tests/fuzz/peer.hpp"
#include "tests/fuzz/refused_with_a_sentence.hpp"
#include "tests/fuzz/scratch.hpp"
#include "tests/fuzz/source.hpp"

namespace {

using namespace takt;
using namespace takt::simulation;
using fuzz::require;
using fuzz::Source;

constexpr int kAnswers = 4;  // to the reset, and to three steps
constexpr std::size_t kJoints = 2;

// A robot with a sensor of values and one of images.
const config::RobotConfig& robot() {
  static const config::RobotConfig one = [] {
    config::RobotConfig made;
    made.robot = "pair";
    made.joints.resize(kJoints);
    made.joints[0].name = "hip";
    made.joints[1].name = "knee";
    made.sensors.push_back({.name = "gauge", .values = 3, .timeout = seconds(1)});
    made.sensors.push_back({.name = "eye", .timeout = seconds(1), .image = config::ImageShape{2, 3, 1}});
    made.simulation.emplace();
    made.simulation->step = milliseconds(1);
    return made;
  }();
  return one;
}

// What the stranger will say, made of the input before the questions come.
struct Script {
  explicit Script(Source& source) {
    const std::uint8_t what = source.byte();
    welcome.header = {sizeof welcome, TAKT_WORLD_WELCOME, TAKT_WORLD_PROTOCOL, 1};
    welcome.gives = what;
    welcome.sensor_count = 3;
    std::strcpy(welcome.world, "fuzz");
    std::strcpy(welcome.sensor, "gauge");
    welcome.camera_count = 1;
    welcome.cameras[0] = {"eye", 2, 3, 1, 0};
    source.spoil(welcome);
    for (std::size_t i = 0; i < kAnswers; ++i) {
      takt_world_state& state = states[i];
      state.header = {sizeof state, TAKT_WORLD_STATE, TAKT_WORLD_PROTOCOL, i + 2};
      state.time_ns = i * 1'000'000;
      state.image_count = i == 0 ? 0 : source.byte() % 3U;
      state.orientation[0] = state.base_orientation[0] = 1;
      state.sensor_sequence = i;
      source.spoil(state);
      images[i] = {0, 6, i, i * 1'000'000};
      source.spoil(images[i]);
      pixels[i] = source.byte() % 4 == 0 ? source.text(source.byte() % 16) : std::string(6, 'p');
    }
  }
  takt_world_welcome welcome{};
  std::array<takt_world_state, kAnswers> states{};
  std::array<takt_world_image, kAnswers> images{};
  std::array<std::string, kAnswers> pixels;
};

template <class Message>
bool say(int socket, const Message& message) {
  return ipc::send_message(socket, std::as_bytes(std::span(&message, 1)), {});
}

void play_by_socket(int socket, const Script& script) {
  for (std::size_t i = 0; i < kAnswers && fuzz::hears(socket); ++i) {
    if (!say(socket, script.states[i])) return;
    if (script.states[i].image_count == 0) continue;
    if (!say(socket, script.images[i])) return;
    (void)ipc::send_message(socket, std::as_bytes(std::span(script.pixels[i])), {});
  }
}

void play_by_memory(int socket, const Script& script, std::span<std::byte> memory) {
  const auto put = [&](std::size_t at, const void* what, std::size_t bytes) {
    std::memcpy(&memory[at], what, std::min(bytes, memory.size() - at));
  };
  for (std::size_t i = 0; i < kAnswers && fuzz::hears(socket); ++i) {
    put(TAKT_WORLD_ANSWER_OFFSET, &script.states[i], sizeof script.states[i]);
    for (std::size_t at = 0; at < 3; ++at)
      put(TAKT_WORLD_IMAGES_OFFSET + at * sizeof script.images[i], &script.images[i], sizeof script.images[i]);
    put(TAKT_WORLD_MEMORY_BYTES, script.pixels[i].data(), script.pixels[i].size());
    if (!say(socket, std::byte{1})) return;
  }
}

void play(int socket, const Script& script) {
  takt_world_hello hello{};
  auto received = ipc::receive_message(socket, std::as_writable_bytes(std::span(&hello, 1)), MSG_WAITALL);
  if (received.size != sizeof hello || received.descriptors.size() != 1 || !say(socket, script.welcome)) return;
  if ((script.welcome.gives & TAKT_WORLD_SHARED_MEMORY) == 0) return play_by_socket(socket, script);
  auto memory = ipc::Segment::adopt_writable(received.descriptors[0].release(), hello.memory_bytes);
  require(memory.has_value());
  play_by_memory(socket, script, memory->writable());
}

bool all_finite(std::span<const double> values) {
  return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
}

void check(OutsideMechanics& world, const ArmState& state, MonoTime now) {
  require(state.q.allFinite() && state.dq.allFinite());
  require(std::isfinite(world.error()) && world.error() >= 0);
  if (const auto imu = world.imu())
    require(all_finite(imu->orientation) && all_finite(imu->angular_velocity) && all_finite(imu->acceleration));
  if (const auto base = world.base()) require(all_finite(base->position) && all_finite(base->orientation));
  require(all_finite(world.tool_position(state.q)));
  if (const auto sample = world.sample(now)) {
    require(sample->value_count == 3 && sample->sensed_at <= now);
    for (std::size_t i = 0; i < sample->value_count; ++i) require(std::isfinite(sample->values[i]));
  }
  for (const OutsideMechanics::Image& image : world.images(now))
    require(image.sensor == 1 && image.sensed.pixels->size() == 6 && image.sensed.sample.sensed_at <= now);
}

void live_in(const std::string& path) {
  auto world = OutsideMechanics::connect(robot(), path, 1, {seconds(1), milliseconds(20)});
  if (!world) return fuzz::require_sentence(world.error().sentence);
  fuzz::require_sentence((*world)->link().world() + ".");
  ArmState state = (*world)->begin();
  const std::vector<Friction> friction(kJoints, Friction{0.1, 0.1});
  MonoTime now{1'000'000'000};
  check(**world, state, now);
  for (int step = 1; step <= kAnswers; ++step) {
    now = now + milliseconds(1);
    (*world)->integrate(state, Eigen::VectorXd::Zero(kJoints), friction, milliseconds(1));
    check(**world, state, now);
    if (const auto end = (*world)->end()) return fuzz::require_sentence(end->sentence);
  }
  require(false);  // it said nothing to the last step
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Source source({data, size});
  const Script script(source);
  const std::string path = fuzz::scratch_folder() + "/world.sock";
  const fuzz::Peer peer(fuzz::listening(path, SOCK_STREAM), [&](int socket) { play(socket, script); });
  live_in(path);
  return 0;
}
