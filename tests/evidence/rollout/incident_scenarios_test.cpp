// Goal: for every scenario that comes with Takt, the incident names the joint or bus that the scenario strikes, and
// what it did to it. Method: the demo arm, and the robot with drives of all five protocols, each of its joints in turn,
// in virtual time: the real decision, the real drivers, the simulated drives, a policy that holds the arm at home;
// buses and camera suffer what the scenario says of them.
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include "config/load.hpp"
#include "evidence/rollout/operator.hpp"
#include "evidence/rollout/virtual_bus.hpp"
#include "executive/incident/incident.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "simulation/robot_plant.hpp"
#include "simulation/scenario_player.hpp"

namespace takt::panel {
namespace {

constexpr std::uint64_t kHash = 7;
constexpr std::uint64_t kAnswerTicks = 12;
constexpr MonoTime kStart{1'000'000'000'000};

const config::RobotConfig& arm6() {
  static const config::RobotConfig loaded = config::load("config/arm6.yaml").value();
  return loaded;
}

// Drives of all five protocols.
const config::RobotConfig& dual_arm12() {
  static const config::RobotConfig loaded = config::load("config/dual_arm12.yaml").value();
  return loaded;
}

class ScenarioRun {
 public:
  ScenarioRun(const config::RobotConfig& robot, const std::string& file)
      : robot_(robot), player_(plant::load_scenario(file, robot).value(), robot, [](const std::string&) {}) {
    input_.now = kStart;
  }

  // Until the robot stops, ten seconds at most.
  std::optional<Incident> run() {
    for (int tick = 0; tick < 10'000; ++tick)
      if (auto incident = step()) return incident;
    return std::nullopt;
  }

 private:
  std::optional<Incident> step() {
    ++input_.tick;
    input_.now = input_.now + config_.period;
    for (; plant_at_ + plant_.step_length() <= input_.now; plant_at_ = plant_at_ + plant_.step_length()) {
      player_.advance(plant_);
      plant_.set_trouble(player_.on_body());
      plant_.step();
    }
    receive();
    deliver();
    input_.operator_request = input_.tick == 1 ? OperatorRequest::none : operator_.next(output_->record, config_);
    pipeline::control_tick(*state_, input_, config_, *output_);
    bus_.send(plant_, input_.now, *output_);
    if (output_->observation_due && player_.on_sensor(0).drop < 0.5) answer(output_->observation);
    return watch_.tick(output_->record);
  }

  // What strangers and bad controllers do beyond what the virtual bus knows: as the edge would report it.
  void receive() {
    bus_.receive(plant_, input_.now, input_);
    for (std::size_t bus = 0; bus < robot_.buses.size(); ++bus) {
      const plant::BusFaults& faults = player_.on_bus(bus);
      BusHealth& health = input_.buses[bus];
      health.state = faults.state;
      health.flooded = faults.babble ? 1 : 0;
      foreign_[bus] += static_cast<std::uint32_t>(faults.rivals_of.size());
      health.foreign_frames += foreign_[bus];
      const bool is_dead = faults.state == BusState::bus_off || faults.state == BusState::down;
      const bool loses = faults.drop > 0 && input_.tick % 5 == 0;
      for (std::size_t joint = 0; joint < robot_.joints.size(); ++joint)
        if (robot_.joints[joint].bus == bus && (is_dead || loses)) input_.joints[joint] = heard_[joint];
    }
    std::copy_n(input_.joints, robot_.joints.size(), heard_.begin());
  }

  void answer(const Observation& observation) {
    auto chunk = std::make_unique<CommandChunk>();
    CommandHeader& header = chunk->header;
    header.observation_id = observation.id;
    header.sequence = ++sequence_;
    header.policy_hash = kHash;
    header.outside_sensed_at = observation.published_at - milliseconds(25);
    header.dequeued_at = header.infer_started_at = observation.published_at + milliseconds(1);
    header.infer_ended_at = header.published_at = observation.published_at + milliseconds(9);
    header.step_period = milliseconds(10);
    header.step_count = 16;
    header.joint_count = static_cast<std::uint16_t>(config_.joint_count);
    header.fields = static_cast<std::uint8_t>(CommandField::q);
    for (std::size_t step = 0; step < header.step_count; ++step)
      for (std::size_t joint = 0; joint < config_.joint_count; ++joint)
        chunk->values[value_index(header, CommandField::q, step, joint)] = config_.joints[joint].home;
    answer_ = std::move(chunk);
    answer_due_ = input_.tick + kAnswerTicks;
  }

  void deliver() {
    const bool due = answer_ && input_.tick >= answer_due_;
    if (due) read_ = std::move(answer_);
    input_.policy.command = due ? read_.get() : nullptr;
    input_.policy.mailbox = due ? Arrival::accepted : Arrival::none;
    input_.policy.bytes = due ? read_->used_bytes() : 0;
    input_.policy.session = 1;
    input_.recorded_through = input_.tick;
  }

  const config::RobotConfig& robot_;
  pipeline::TickConfig config_ = config::tick_config_of(robot_, kHash);
  pipeline::TickStatePtr state_ = pipeline::make_tick_state(config_);
  plant::RobotPlant plant_ = plant::RobotPlant::make(robot_, std::array{1.0}).value();
  Disturbance calm_{{}, kStart};
  VirtualBus bus_ = VirtualBus::make(robot_, calm_, 1).value();
  plant::ScenarioPlayer player_;
  Operator operator_{std::nullopt};
  IncidentWatch watch_{robot_};
  pipeline::TickInput input_;
  std::unique_ptr<pipeline::TickOutput> output_ = std::make_unique<pipeline::TickOutput>();
  std::unique_ptr<CommandChunk> answer_, read_;
  std::uint64_t answer_due_ = 0, sequence_ = 0;
  std::array<std::uint32_t, kMaxBuses> foreign_{};
  std::array<JointFeedback, kMaxJoints> heard_{};
  MonoTime plant_at_ = kStart;
};

struct Told {
  const char* scenario;
  const char* where;
  const char* words;  // in the sentence
};
constexpr Told kTold[] = {
    {"bad_line", "joint elbow", "more replies than commands"},
    {"bus_down", "bus can1", "down or gone"},
    {"bus_errors", "bus can0", "error-passive"},
    {"crowded_bus", "bus can0", "more frames than our drives say"},
    {"deaf_drive", "joint elbow", "silent for"},
    {"drive_error", "joint elbow", "over-temperature"},
    {"poor_sight", "", "no usable command came"},
    {"power_cycle", "joint elbow", "silent for"},
    {"rival", "bus can0", "frames foreign"},
    {"silent_drive", "joint elbow", "silent for"},
};

TEST(IncidentScenarios, EverySentenceNamesThePlaceAndTheFault) {
  for (const Told& told : kTold) {
    SCOPED_TRACE(told.scenario);
    const auto incident = ScenarioRun(arm6(), "config/scenarios/" + std::string(told.scenario) + ".yaml").run();
    ASSERT_TRUE(incident);
    EXPECT_EQ(incident->where, told.where);
    EXPECT_NE(incident->sentence.find(told.words), std::string::npos);
    EXPECT_FALSE(incident->asked);
  }
}

// A scenario that comes with Takt, struck at another joint, and at that joint's bus.
std::string struck_at(const char* scenario, const config::Joint& joint) {
  std::stringstream text;
  text << std::ifstream("config/scenarios/" + std::string(scenario) + ".yaml").rdbuf();
  const std::string path = testing::TempDir() + scenario + "-" + joint.name + ".yaml";
  std::ofstream(path) << std::regex_replace(
      std::regex_replace(text.str(), std::regex("joint: elbow"), "joint: " + joint.name), std::regex("bus: can[01]"),
      "bus: " + dual_arm12().buses[joint.bus].name);
  return path;
}

std::string words_of(const Told& told, const config::Joint& joint) {
  // An ODrive goes on telling where it is, so it is heard to say that it misses its commands.
  const bool tells_anyway = joint.drive.protocol == config::DriveProtocol::odrive;
  return std::string_view(told.scenario) == "deaf_drive" && tells_anyway ? "command watchdog expired" : told.words;
}

// Six bytes of reply have no room for an error.
bool can_tell(const Told& told, const config::Joint& joint) {
  return std::string_view(told.scenario) != "drive_error" || joint.drive.variant != "tmotor";
}

class MixedDriveScenarios : public testing::TestWithParam<std::size_t> {};

TEST_P(MixedDriveScenarios, EverySentenceNamesThePlaceAndTheFault) {
  const config::Joint& joint = dual_arm12().joints[GetParam()];
  for (const Told& told : kTold) {
    SCOPED_TRACE(told.scenario);
    const auto incident = ScenarioRun(dual_arm12(), struck_at(told.scenario, joint)).run();
    ASSERT_EQ(incident.has_value(), can_tell(told, joint));
    if (!incident) continue;
    const std::string_view kind = std::string_view(told.where).substr(0, std::string_view(told.where).find(' '));
    EXPECT_EQ(incident->where, kind == "joint" ? "joint " + joint.name
                               : kind == "bus" ? "bus " + dual_arm12().buses[joint.bus].name
                                               : "");
    EXPECT_NE(incident->sentence.find(words_of(told, joint)), std::string::npos) << incident->sentence;
    EXPECT_FALSE(incident->asked);
  }
}

INSTANTIATE_TEST_SUITE_P(EveryJoint, MixedDriveScenarios, testing::Range<std::size_t>(0, 12),
                         [](const auto& joint) { return dual_arm12().joints[joint.param].name; });

// rough_handling strikes the body, which this arm bears: a robot that goes on has no incident.
TEST(IncidentScenarios, EveryScenarioThatComesWithTaktIsJudged) {
  std::set<std::string> judged{"rough_handling"};
  for (const Told& told : kTold) judged.insert(told.scenario);
  for (const auto& file : std::filesystem::directory_iterator("config/scenarios"))
    EXPECT_TRUE(judged.contains(file.path().stem().string())) << file.path() << " has no row in kTold";
}

}  // namespace
}  // namespace takt::panel
