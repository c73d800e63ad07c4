// SPDX-License-Identifier: Apache-2.0
// A process in a robot's DDS domain that means ill: it listens to the robot and its server, then writes a few messages
// that only they should write, says so, and stays until it is ended.
//   remote_stranger ROBOT_FILE observations   three observations of the robot's session, with the largest id there is
//   remote_stranger ROBOT_FILE sessions       three observations, each of a session of its own
//   remote_stranger ROBOT_FILE answers        three answers under the server's number, with the largest number there is
//   remote_stranger ROBOT_FILE blind          without dds.security, whatever the file says, and without listening: says
//                                             that it is a policy server, again and again
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <optional>
#include <string_view>
#include <vector>

#include "config/load.hpp"
#include "policy_host/remote/topics.hpp"

namespace takt::policy_host::remote {
namespace {

constexpr int kMessages = 3;
constexpr useconds_t kPause = 5'000;

// What was heard of the two last, with the numbers that it refers to.
struct Heard {
  std::optional<takt_remote_Observation> observation;
  std::optional<takt_remote_Command> answer;
  std::array<float, kMaxJoints> joints{};
  std::array<takt_remote_SampleReference, 16> samples{};
  std::vector<float> values;

  void take(const takt_remote_Observation& message) {
    observation = message;
    std::copy_n(message.samples._buffer, message.samples._length, samples.begin());
    for (auto* const part :
         {&observation->q, &observation->dq, &observation->tau, &observation->q_setpoint, &observation->dq_of_drive})
      part->_buffer = joints.data();
    observation->imu._length = 0;
    observation->samples._buffer = samples.data();
  }
  void take(const takt_remote_Command& message) {
    answer = message;
    values.assign(message.values._buffer, message.values._buffer + message.values._length);
    answer->values._buffer = values.data();
  }
};

// In a domain that is open it is taken for a server that has no policy.
int call_out(config::RobotConfig robot) {
  robot.dds->security.clear();
  const auto domain = dds::Domain::open(robot, "remote_stranger");
  if (!domain) return fmt::print(stderr, "{}\n", domain.error()), 1;
  const auto observed = make_reader(*domain, robot, Topic::observation);  // as a server's
  const auto status = make_writer(*domain, robot, Topic::status);
  if (!observed || !status) return 1;
  takt_remote_ServerStatus message{};
  message.server = drawn_number();
  std::string_view("stranger").copy(message.name, sizeof message.name - 1);
  for (int sent = 0;; ++sent, usleep(kPause)) {
    if (dds_write(*status, &message) != DDS_RETCODE_OK) return 1;
    if (sent != 100) continue;
    fmt::print("sent\n");
    std::fflush(stdout);
  }
}

int disturb(const config::RobotConfig& robot, std::string_view how) {
  const auto domain = dds::Domain::open(robot, "remote_stranger");
  if (!domain) return fmt::print(stderr, "{}\n", domain.error()), 1;
  const auto observed = make_reader(*domain, robot, Topic::observation);
  const auto answered = make_reader(*domain, robot, Topic::command);
  const auto observations = make_writer(*domain, robot, Topic::observation);
  const auto answers = make_writer(*domain, robot, Topic::command);
  if (!observed || !answered || !observations || !answers) return 1;
  Heard heard;
  const auto listen = [&] {
    take_all<takt_remote_Observation>(*observed, [&](const auto& message, const PeerId&) { heard.take(message); });
    take_all<takt_remote_Command>(*answered, [&](const auto& message, const PeerId&) { heard.take(message); });
  };
  dds_publication_matched_status_t matched{};
  const dds_entity_t writer = how == "answers" ? *answers : *observations;
  while (!heard.observation || !heard.answer || matched.current_count < 2) {  // its own reader, and the other's
    listen();
    dds_get_publication_matched_status(writer, &matched);
    usleep(kPause);
  }
  for (int sent = 0; sent < kMessages; ++sent) {
    for (int pause = 0; pause < 10; ++pause, usleep(kPause)) listen();
    heard.observation->id = UINT64_MAX;
    if (how == "sessions") heard.observation->epoch = drawn_number();
    heard.answer->number = UINT64_MAX;
    const bool is_written = how == "answers" ? dds_write(writer, &*heard.answer) == DDS_RETCODE_OK
                                             : dds_write(writer, &*heard.observation) == DDS_RETCODE_OK;
    if (!is_written) return 1;
    // What this process wrote is not what it is to repeat.
    usleep(kPause);
    listen();
    heard.observation.reset();
    heard.answer.reset();
    while (!heard.observation || !heard.answer) {
      usleep(kPause);
      listen();
    }
  }
  fmt::print("sent\n");
  std::fflush(stdout);
  while (true) pause();
}

}  // namespace
}  // namespace takt::policy_host::remote

int main(int argc, char** argv) {
  if (argc != 3) return 64;
  const auto robot = takt::config::load(argv[1]);
  if (!robot) return fmt::print(stderr, "{}\n", robot.error()), 65;
  if (std::string_view(argv[2]) == "blind") return takt::policy_host::remote::call_out(*robot);
  return takt::policy_host::remote::disturb(*robot, argv[2]);
}
