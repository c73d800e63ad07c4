// SPDX-License-Identifier: Apache-2.0
// Goal: ROS 2's wire carries what the robot did: names, types, type hashes and every number; and none in the domain
// moves the robot unless its file allows it. Method: a robot of real processes with a `dds` section of its own domain
// on loopback; Fast DDS as the other side; every number compared with the run folder's record of the same tick, and the
// mode with the operator's socket.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <stdexcept>
#include <thread>

#include "dds/type_hash.hpp"
#include "monitor/record/recorded_run.hpp"
#include "tests/process/fast_messages.hpp"
#include "tests/process/fastdds_peer.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/support/files.hpp"
#include "tests/support/replaced.hpp"

namespace takt::test {
namespace {

constexpr const char* kJointStates = "rt/joint_states";
constexpr const char* kDiagnostics = "rt/diagnostics";
constexpr const char* kStatus = "rt/takt/status";
constexpr const char* kCommandAge = "rt/takt/command_age";
constexpr const char* kRequest = "rt/takt/request";

class DdsTest : public testing::Test {
 protected:
  // config/arm6.yaml under a name of its own, with DDS.
  void start(bool allow_requests) {
    name_ = "arm6-dds-" + std::to_string(getpid());
    std::string text = replaced(text_of("config/arm6.yaml"), "robot: arm6", "robot: " + name_);
    text = replaced(text, "file: arm6_reach.onnx",
                    "file: " + (std::filesystem::current_path() / "config/arm6_reach.onnx").string());
    text += "\ndds:\n  domain: " + std::to_string(domain_of_this_test()) + "\n  joint_state_rate: 200 Hz\n" +
            "  allow_requests: " + (allow_requests ? "true" : "false") + "\n";
    file_ = testing::TempDir() + name_ + ".yaml";
    std::ofstream(file_) << text;
    robot_.emplace("", file_);
    policy_.emplace(robot_->start_policy_host());
    peer_.emplace(domain_of_this_test());
    peer_->listen(kStatus, "takt_msgs::msg::dds_::Status_");
  }
  ~DdsTest() override {
    policy_.reset();
    robot_.reset();
    std::error_code ignored;
    std::filesystem::remove(file_, ignored);
  }

  static bool until(const std::function<bool()>& holds) {
    for (int poll = 0; poll < 1000; ++poll) {
      if (holds()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return holds();
  }
  // The first status that holds; of those that came since the last one found.
  std::optional<FastStatus> find_status(const std::function<bool(const FastStatus&)>& holds) {
    const auto& all = peer_->received(kStatus);
    while (looked_at_ < all.size()) {
      const FastStatus status = decode_status(all[looked_at_++]);
      if (holds(status)) return status;
    }
    return std::nullopt;
  }
  std::optional<FastStatus> until_status(const std::function<bool(const FastStatus&)>& holds) {
    std::optional<FastStatus> found;
    until([&] { return (found = find_status(holds)).has_value(); });
    return found;
  }

  std::string name_, file_;
  std::optional<RunningRobot> robot_;
  std::optional<Child> policy_;
  std::optional<FastDdsPeer> peer_;
  std::size_t looked_at_ = 0;  // status messages
};

struct Records {
  std::int64_t offset_ns = 0;
  std::vector<std::string> joints;
  std::map<std::uint64_t, TickRecord> by_tick;
  std::multimap<std::int64_t, std::uint64_t> ticks_of_oldest_sample;  // stamp, Unix ns; a silent joint's has many
};

Records read_records(const std::string& directory) {
  Records records;
  const auto run = monitor::open_run(directory);
  EXPECT_TRUE(run.has_value()) << run.error();
  if (!run) return records;
  records.offset_ns = run->manifest.clock.monotonic_to_unix_ns;
  records.joints = run->manifest.joints;
  const auto tick = [&](const monitor::RecordedTick& recorded) {
    const TickRecord& record = recorded.record;
    records.by_tick[record.header.tick] = record;
    MonoTime oldest = record.header.now;
    for (std::size_t j = 0; j < record.header.joint_count; ++j)
      oldest = std::min(oldest, record.joints[j].feedback.received_at);
    records.ticks_of_oldest_sample.emplace(oldest.ns + records.offset_ns, record.header.tick);
  };
  const auto scan = monitor::scan_run(*run, {.tick = tick, .command = {}, .keyframe = {}, .loss = {}});
  EXPECT_TRUE(scan.has_value()) << scan.error();
  return records;
}

bool has_numbers_of(const FastJointState& told, const TickRecord& record) {
  for (std::size_t j = 0; j < told.position.size(); ++j) {
    const JointRecord& joint = record.joints[j];
    if (told.position[j] != static_cast<double>(joint.feedback.q)) return false;
    if (told.velocity[j] != static_cast<double>(joint.dq_estimate)) return false;
    if (told.effort[j] != static_cast<double>(joint.feedback.tau)) return false;
  }
  return true;
}

void expect_as_recorded(const FastJointState& told, const Records& records) {
  EXPECT_EQ(told.name, records.joints);
  EXPECT_EQ(told.frame_id, "");
  ASSERT_EQ(told.position.size(), records.joints.size());
  ASSERT_EQ(told.velocity.size(), records.joints.size());
  ASSERT_EQ(told.effort.size(), records.joints.size());
  const auto [first, last] = records.ticks_of_oldest_sample.equal_range(told.unix_ns);
  ASSERT_NE(first, last) << "a stamp that no record has";
  EXPECT_TRUE(
      std::any_of(first, last, [&](const auto& tick) { return has_numbers_of(told, records.by_tick.at(tick.second)); }))
      << "numbers of no record with the stamp " << told.unix_ns;
}

void expect_as_recorded(const FastStatus& told, const Records& records) {
  if (!told.running) return;
  const auto record = records.by_tick.find(told.tick);
  ASSERT_NE(record, records.by_tick.end()) << told.tick;
  const TickRecordHeader& header = record->second.header;
  EXPECT_EQ(told.unix_ns, header.now.ns + records.offset_ns);
  EXPECT_EQ(told.mode, name(header.mode));
  EXPECT_EQ(told.freshness, name(header.seats[Seat::policy].freshness));
  EXPECT_EQ(told.age_ns, header.age.total().ns);
  EXPECT_EQ(told.window_misses, header.window_misses);
  EXPECT_EQ(told.window_ticks, header.window_ticks);
  EXPECT_EQ(told.skipped_periods, header.skipped_periods);
  EXPECT_EQ(told.refused_commands, header.refused_commands);
  EXPECT_EQ(told.integration_errors, header.integration_errors);
  EXPECT_EQ(told.command_sequence, header.seats[Seat::policy].command_sequence);
  EXPECT_EQ(told.observation_answered, header.seats[Seat::policy].observation_answered);
  EXPECT_EQ(told.drives_enabled, header.drives_enabled != 0);
}

void expect_as_recorded(const FastCommandAge& told, const Records& records) {
  const auto record = records.by_tick.find(told.tick);
  ASSERT_NE(record, records.by_tick.end()) << told.tick;
  const TickRecordHeader& header = record->second.header;
  EXPECT_EQ(header.seats[Seat::policy].arrival, Arrival::accepted) << "first use";
  EXPECT_EQ(told.unix_ns, header.now.ns + records.offset_ns);
  EXPECT_EQ(told.command_sequence, header.seats[Seat::policy].command_sequence);
  EXPECT_EQ(told.observation_id, header.seats[Seat::policy].observation_answered);
  EXPECT_EQ(told.sense_ns, header.age.sense.ns);
  EXPECT_EQ(told.queue_ns, header.age.queue.ns);
  EXPECT_EQ(told.infer_ns, header.age.infer.ns);
  EXPECT_EQ(told.publish_ns, header.age.publish.ns);
  EXPECT_EQ(told.hold_ns, header.age.hold.ns);
  EXPECT_EQ(told.total_ns, told.sense_ns + told.queue_ns + told.infer_ns + told.publish_ns + told.hold_ns);
}

void expect_announced(const std::map<std::string, Endpoint>& endpoints, const std::string& topic,
                      const std::string& package, const std::string& message) {
  ASSERT_TRUE(endpoints.contains(topic)) << topic;
  EXPECT_EQ(endpoints.at(topic).type, package + "::msg::dds_::" + message + "_");
  EXPECT_EQ(endpoints.at(topic).user_data, dds::user_data(package + "/msg/" + message));
}

bool has_mapped(pid_t pid, const std::string& library) {
  const std::string text = text_of("/proc/" + std::to_string(pid) + "/maps");
  return text.find(library) != std::string::npos;
}

TEST_F(DdsTest, AnotherVendorsDdsHearsWhatWasRecorded) {
  start(false);
  peer_->listen(kJointStates, "sensor_msgs::msg::dds_::JointState_");
  peer_->listen(kDiagnostics, "diagnostic_msgs::msg::dds_::DiagnosticArray_");
  peer_->listen(kCommandAge, "takt_msgs::msg::dds_::CommandAge_");
  ASSERT_EQ(robot_->arm(), "") << robot_->logs();
  ASSERT_TRUE(until([&] {
    return peer_->received(kJointStates).size() > 50 && peer_->received(kCommandAge).size() > 20 &&
           peer_->received(kDiagnostics).size() > 1;
  })) << robot_->logs();
  const auto told = until_status([](const FastStatus& status) { return status.mode == "tracking"; });
  ASSERT_TRUE(told.has_value()) << robot_->logs();
  EXPECT_EQ(told->robot, name_);
  const auto socket = robot_->status();
  ASSERT_TRUE(socket.has_value());
  EXPECT_LE(told->tick, socket->status.tick.tick);
  EXPECT_LE(told->command_sequence, socket->status.tick.seats[Seat::policy].command_sequence);

  const auto writers = peer_->writers();
  expect_announced(writers, kJointStates, "sensor_msgs", "JointState");
  expect_announced(writers, kDiagnostics, "diagnostic_msgs", "DiagnosticArray");
  expect_announced(writers, kStatus, "takt_msgs", "Status");
  expect_announced(writers, kCommandAge, "takt_msgs", "CommandAge");
  EXPECT_EQ(writers.at(kJointStates).user_data,
            "typehash=RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e;");
  EXPECT_TRUE(has_mapped(robot_->monitor().pid(), "libddsc"));
  EXPECT_FALSE(has_mapped(robot_->executive().pid(), "libddsc")) << "the executive must never load DDS";
  EXPECT_FALSE(has_mapped(policy_->pid(), "libddsc"));

  ASSERT_TRUE(robot_->finish()) << robot_->logs();
  const Records records = read_records(robot_->run_directory());
  for (const Payload& payload : peer_->received(kJointStates)) expect_as_recorded(decode_joint_state(payload), records);
  for (const Payload& payload : peer_->received(kStatus)) expect_as_recorded(decode_status(payload), records);
  for (const Payload& payload : peer_->received(kCommandAge)) expect_as_recorded(decode_command_age(payload), records);
  const auto diagnostics = decode_diagnostics(peer_->received(kDiagnostics).front());
  ASSERT_EQ(diagnostics.size(), 1 + records.joints.size() + 2) << "executive, joints, two buses";
  EXPECT_EQ(diagnostics[0].name, name_ + ": executive");
  EXPECT_EQ(diagnostics[1].name, name_ + ": joint " + records.joints[0]);
  EXPECT_EQ(diagnostics[1].hardware_id, name_);
}

TEST_F(DdsTest, RequestsArmAndStopWhereTheFileAllowsThem) {
  start(true);
  peer_->offer(kRequest, "takt_msgs::msg::dds_::Request_");
  ASSERT_TRUE(until([&] { return peer_->is_matched(kRequest); })) << robot_->logs();
  expect_announced(peer_->readers(), kRequest, "takt_msgs", "Request");

  // Repeated: what is sent before the other side knows of our writer is lost, as ever with volatile topics.
  std::optional<FastStatus> refused;
  until([&] {
    peer_->send(kRequest, encode_request("another-robot", 1, "arm"));
    peer_->send(kRequest, encode_request(name_, 2, "dance"));
    return (refused = find_status([](const FastStatus& status) { return status.request_id != 0; })).has_value();
  });
  ASSERT_TRUE(refused.has_value()) << robot_->logs();
  EXPECT_EQ(refused->request_id, 2U) << "requests to other robots are not answered";
  EXPECT_FALSE(refused->request_done);
  EXPECT_EQ(refused->request_answer, "`dance` is no request; write arm or stop");

  // Refused with what is missing until the robot is ready, as at the operator's socket.
  std::uint64_t id = 2;
  std::string answer;
  ASSERT_TRUE(until([&] {
    peer_->send(kRequest, encode_request(name_, ++id, "arm"));
    const auto answered = until_status([&](const FastStatus& status) { return status.request_id == id; });
    answer = answered ? answered->request_answer : "no answer";
    return answered && answered->request_done;
  })) << answer;
  ASSERT_TRUE(until_status([](const FastStatus& status) { return status.mode == "tracking"; })) << robot_->logs();

  // A stop for another robot is not answered, let alone obeyed, for many a status.
  constexpr std::uint64_t kForAnother = 1'000'000;
  ASSERT_TRUE(peer_->send(kRequest, encode_request("another-robot", kForAnother, "stop")));
  int passed = 0;
  ASSERT_TRUE(until_status([&](const FastStatus& status) {
    EXPECT_NE(status.request_id, kForAnother);
    return ++passed > 10;
  }));

  ASSERT_TRUE(peer_->send(kRequest, encode_request(name_, ++id, "stop")));
  const auto stopped =
      until_status([&](const FastStatus& status) { return status.request_id == id && status.mode == "damped_stop"; });
  ASSERT_TRUE(stopped.has_value()) << robot_->logs();
  EXPECT_TRUE(stopped->request_done);
  EXPECT_EQ(stopped->cause, "operator_stop");
  const auto socket = robot_->status();
  ASSERT_TRUE(socket.has_value());
  EXPECT_EQ(socket->status.tick.mode, Mode::damped_stop);
}

// The namesake is another vendor's participant that tells the same robot's name and another machine's.
// Threat: dds-namesake
TEST_F(DdsTest, ARequestWithoutAMachineArmsNoneOfTwoNamesakes) {
  start(true);
  FastDdsPeer namesake(domain_of_this_test());
  namesake.offer(kStatus, "takt_msgs::msg::dds_::Status_");
  peer_->offer(kRequest, "takt_msgs::msg::dds_::Request_");
  ASSERT_TRUE(until([&] { return peer_->is_matched(kRequest) && namesake.is_matched(kStatus); })) << robot_->logs();
  // Nothing can be armed before the namesake was seen.
  policy_.reset();
  std::uint64_t id = 0;
  const auto ask = [&](const std::string& machine) {
    FastStatus status;
    status.robot = name_;
    status.machine = "bb22";
    namesake.send(kStatus, encode_status(status));
    peer_->send(kRequest, encode_request(name_, ++id, "arm", machine));
    return until_status([&](const FastStatus& told) { return told.request_id == id && told.machine != "bb22"; });
  };
  std::optional<FastStatus> told;
  ASSERT_TRUE(until([&] {
    told = ask("");
    return told && told->request_answer.find("more than one robot is named") == 0;
  })) << (told ? told->request_answer : "no answer");
  EXPECT_FALSE(told->request_done);
  EXPECT_NE(told->request_answer.find("bb22"), std::string::npos) << told->request_answer;
  const std::string here = told->machine;
  policy_.emplace(robot_->start_policy_host());
  ASSERT_TRUE(until([&] {
    told = ask(here);
    return told && told->request_done;
  })) << (told ? told->request_answer : "no answer");
}

// Threat: dds-request
TEST_F(DdsTest, RequestsFindNobodyWhereTheFileDoesNotAllowThem) {
  start(false);
  peer_->offer(kRequest, "takt_msgs::msg::dds_::Request_");
  ASSERT_TRUE(until_status([](const FastStatus& status) { return status.running; })) << robot_->logs();
  // The robot is ready for it, as the operator's socket shows afterwards; requests are repeated for many a status.
  const std::size_t before = peer_->received(kStatus).size();
  std::uint64_t id = 0;
  ASSERT_TRUE(until([&] {
    peer_->send(kRequest, encode_request(name_, ++id, "arm"));
    return peer_->received(kStatus).size() > before + 10;
  })) << robot_->logs();
  EXPECT_FALSE(peer_->is_matched(kRequest));
  EXPECT_FALSE(peer_->readers().contains(kRequest)) << "there is no reader at all";
  for (const Payload& payload : peer_->received(kStatus)) {
    const FastStatus status = decode_status(payload);
    EXPECT_EQ(status.request_verb, "");
    if (status.running) {
      EXPECT_EQ(status.mode, "standby");
    }
  }
  EXPECT_EQ(robot_->arm(), "") << "it could have been armed";
}

}  // namespace
}  // namespace takt::test
