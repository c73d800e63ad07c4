// Goal: for every scenario that comes with Takt, the incident names the joint or bus that the scenario strikes, and
// what it did to it. Method: the demo arm in virtual time: the real decision, the real drivers, the simulated drives, a
// policy that holds the arm at home; buses and camera suffer what the scenario says of them.
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <set>

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

const config::RobotConfig& robot() {
  static const config::RobotConfig loaded = config::load("config/arm6.yaml").value();
  return loaded;
}

class ScenarioRun {
 public:
  explicit ScenarioRun(const std::string& file)
      : player_(plant::load_scenario(file, robot()).value(), robot().buses.size(), [](const std::string&) {}) {
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
    if (output_->observation_due && player_.on_sensor().drop < 0.5) answer(output_->observation);
    return watch_.tick(output_->record);
  }

  // What strangers and bad controllers do beyond what the virtual bus knows: as the edge would report it.
  void receive() {
    bus_.receive(plant_, input_.now, input_);
    for (std::size_t bus = 0; bus < robot().buses.size(); ++bus) {
      const plant::BusFaults& faults = player_.on_bus(bus);
      BusHealth& health = input_.buses[bus];
      health.state = faults.state;
      health.flooded = faults.babble ? 1 : 0;
      foreign_[bus] += static_cast<std::uint32_t>(faults.rivals_of.size());
      health.foreign_frames += foreign_[bus];
      const bool is_dead = faults.state == BusState::bus_off || faults.state == BusState::down;
      const bool loses = faults.drop > 0 && input_.tick % 5 == 0;
      for (std::size_t joint = 0; joint < robot().joints.size(); ++joint)
        if (robot().joints[joint].bus == bus && (is_dead || loses)) input_.joints[joint] = heard_[joint];
    }
    std::copy_n(input_.joints, robot().joints.size(), heard_.begin());
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
    input_.command = due ? read_.get() : nullptr;
    input_.mailbox = due ? Arrival::accepted : Arrival::none;
    input_.command_bytes = due ? read_->used_bytes() : 0;
    input_.policy_session = 1;
    input_.recorded_through = input_.tick;
  }

  pipeline::TickConfig config_ = config::tick_config_of(robot(), kHash);
  pipeline::TickStatePtr state_ = pipeline::make_tick_state(config_);
  plant::RobotPlant plant_ = plant::RobotPlant::make(robot(), std::array{1.0}).value();
  Disturbance calm_{{}, kStart};
  VirtualBus bus_ = VirtualBus::make(robot(), calm_, 1).value();
  plant::ScenarioPlayer player_;
  Operator operator_{std::nullopt};
  IncidentWatch watch_{robot()};
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
    {"poor_sight", "", "the policy gave no usable command"},
    {"power_cycle", "joint elbow", "silent for"},
    {"rival", "bus can0", "frames foreign"},
    {"silent_drive", "joint elbow", "silent for"},
};

TEST(IncidentScenarios, EverySentenceNamesThePlaceAndTheFault) {
  for (const Told& told : kTold) {
    SCOPED_TRACE(told.scenario);
    const auto incident = ScenarioRun("config/scenarios/" + std::string(told.scenario) + ".yaml").run();
    ASSERT_TRUE(incident);
    EXPECT_EQ(incident->where, told.where);
    EXPECT_NE(incident->sentence.find(told.words), std::string::npos);
    EXPECT_FALSE(incident->asked);
  }
}

// rough_handling strikes the body, which this arm bears: a robot that goes on has no incident.
TEST(IncidentScenarios, EveryScenarioThatComesWithTaktIsJudged) {
  std::set<std::string> judged{"rough_handling"};
  for (const Told& told : kTold) judged.insert(told.scenario);
  for (const auto& file : std::filesystem::directory_iterator("config/scenarios"))
    EXPECT_TRUE(judged.contains(file.path().stem().string())) << file.path() << " has no row in kTold";
}

}  // namespace
}  // namespace takt::panel
