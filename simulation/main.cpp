// SPDX-License-Identifier: Apache-2.0
// takt-plant: the device side of a simulated robot. Drives on the CAN buses, behind them an arm or a cart with a pole,
// and a camera; or nothing but flywheels; and what a scenario file lets go wrong.
// Exit codes: 0 ended by a signal, 64 usage, 65 robot, devices or scenario file refused, 69 a bus or socket is not to
// be had, or the world of --world ended otherwise than by success, 70 internal.
#include <sched.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <functional>
#include <optional>
#include <vector>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "executive/program/program.hpp"
#include "simulation/devices_file.hpp"
#include "simulation/outside_mechanics.hpp"
#include "simulation/pacer.hpp"
#include "simulation/plant_buses.hpp"
#include "simulation/robot_plant.hpp"
#include "simulation/scenario_player.hpp"
#include "simulation/simulated_sensors.hpp"
#include "simulation/truth_log.hpp"

namespace takt::simulation {
namespace {

constexpr int kPriority = 10;  // SCHED_FIFO
constexpr Duration kTruthPeriod = milliseconds(10);
constexpr Duration kReportPeriod = seconds(1);

struct Options : program::RobotOptions {
  std::string devices, scenario, truth_file, world;
  std::optional<std::uint64_t> seed;
  double target_entry_s = 0;
  bool on_hardware = false, debug = false;
};

using program::refuse;

// Drives and arms do not wait for a CPU: their double should not either. Far below the executive; the work per turn is
// bounded. Calling thread only.
void ask_for_punctuality() {
  ::prctl(PR_SET_TIMERSLACK, 1'000UL);  // ns; the default of 50 us is a twentieth of a step
  const sched_param wanted{.sched_priority = kPriority};
  if (::sched_setscheduler(0, SCHED_FIFO, &wanted) != 0)
    spdlog::info("no real-time priority to be had: on a busy machine the simulated drives will answer late");
}

// What happens beside a robot's simulation: its sensors, the truth file, a line per second.
class Observer {
 public:
  // `started`: when the target was at the beginning of its path.
  Observer(const config::Simulation& simulation, MonoTime started, SimulatedSensors sensors,
           std::optional<TruthLog> truth)
      : simulation_(simulation),
        started_(started),
        sensors_(std::move(sensors)),
        truth_(std::move(truth)),
        next_truth_(started),
        next_report_(started) {}

  [[nodiscard]] const SimulatedSensors& sensors() const { return sensors_; }

  void look(RobotPlant& body, const ScenarioPlayer& scenario, const Pacer& pacer, MonoTime now) {
    sensors_.look(body, scenario, now);
    if (truth_ && now >= next_truth_) {
      next_truth_ = now + kTruthPeriod;
      truth_->write(truth_of(body, now));
    }
    if (now < next_report_) return;
    next_report_ = now + kReportPeriod;
    if (truth_) truth_->flush();
    spdlog::debug("{:.1f} mm from the target, {} steps skipped", 1e3 * tool_error(truth_of(body, now)),
                  pacer.skipped());
  }

 private:
  [[nodiscard]] Truth truth_of(RobotPlant& body, MonoTime now) const {
    return {now, body.state(), body.controlled_point(), target_at(simulation_, now - started_)};
  }

  const config::Simulation& simulation_;
  MonoTime started_;
  SimulatedSensors sensors_;
  std::optional<TruthLog> truth_;
  MonoTime next_truth_, next_report_;
};

struct Stage {
  Plant& plant;
  RobotPlant* body;         // the plant, if it is a robot
  OutsideMechanics* world;  // the robot's, if another process plays it
  PlantBuses& buses;
  ScenarioPlayer& scenario;
  std::size_t bus_count;
  Pacer& pacer;
};

void simulate(const Stage& stage, const std::atomic<bool>& stop, const std::function<void(MonoTime)>& observe) {
  while (!stop && !(stage.world && stage.world->end())) {
    sleep_until(stage.pacer.next_wake());
    const MonoTime now = monotonic_now();
    const int steps = stage.pacer.steps_due(now);
    if (steps == 0) continue;
    if (const MonoTime newest = stage.buses.exchange(stage.plant, steps); newest.is_set()) stage.pacer.follow(newest);
    for (int i = 0; i < steps; ++i) {
      stage.scenario.advance(stage.plant);
      if (stage.body) stage.body->set_trouble(stage.scenario.on_body());
      stage.plant.step();
    }
    for (std::size_t bus = 0; bus < stage.bus_count; ++bus) stage.buses.set_faults(bus, stage.scenario.on_bus(bus));
    observe(now);
  }
}

std::expected<Observer, std::string> open_observer(const Options& options, const config::RobotConfig& robot,
                                                   const std::string& directory, RobotPlant& body,
                                                   OutsideMechanics* world) {
  const auto policy_user = program::policy_user_of(options);
  if (!policy_user) return std::unexpected(policy_user.error());
  const MonoTime started = monotonic_now() - Duration{std::llround(options.target_entry_s * 1e9)};
  auto sensors = SimulatedSensors::open(robot, directory, *policy_user, started, body, world);
  if (!sensors) return std::unexpected(sensors.error());
  std::optional<TruthLog> truth;
  if (!options.truth_file.empty()) {
    auto created = TruthLog::create(options.truth_file);
    if (!created) return std::unexpected(created.error());
    truth = std::move(*created);
  }
  return Observer(*robot.simulation, started, std::move(*sensors), std::move(truth));
}

// What the scenario wants of a bus that only the loopback hub can do. Empty: nothing amiss.
std::string unplayable(const Scenario& scenario, const PlantBuses& buses, const std::string& file) {
  for (const FaultEvent& event : scenario.events) {
    const bool state =
        event.kind == FaultKind::error_passive || event.kind == FaultKind::bus_off || event.kind == FaultKind::down;
    if (state && !buses.has_states(event.target))
      return file + ": bus " + event.target_name + " is an interface of the kernel; only a loopback bus can be made " +
             text_of(event) + ": remove the event or the interface";
  }
  return {};
}

int serve(const Options& options, const config::RobotConfig& robot, Scenario scenario, Plant& plant, RobotPlant* body,
          OutsideMechanics* world) {
  const std::string directory = program::runtime_directory_of(options, robot);
  const std::atomic<bool>& stop = program::stop_on_signals();
  std::optional<Observer> observer;
  if (body != nullptr) {
    auto opened = open_observer(options, robot, directory, *body, world);
    if (!opened) return refuse(kExitUnavailable, opened.error());
    observer.emplace(std::move(*opened));
    if (const std::string why = observer->sensors().unplayed(scenario, options.scenario); !why.empty())
      return refuse(config::kExitBadConfiguration, why);
  }
  auto buses = PlantBuses::open(robot, directory, options.on_hardware);
  if (!buses) return refuse(kExitUnavailable, buses.error());
  if (const std::string why = unplayable(scenario, *buses, options.scenario); !why.empty())
    return refuse(config::kExitBadConfiguration, why);
  for (const std::string& description : buses->descriptions()) spdlog::info("bus {}", description);
  spdlog::info("{} {}, stepping every {:.3f} ms, seed {}", plant.joint_count(),
               body ? "joints at home" : "devices on flywheels", plant.step_length().milliseconds(),
               robot.simulation->seed);

  if (body != nullptr)
    for (const std::string& note : body->notes()) spdlog::info("model: {}", note);

  ask_for_punctuality();
  Pacer pacer(plant.step_length(), monotonic_now() + plant.step_length());
  ScenarioPlayer player(std::move(scenario), robot,
                        [](const std::string& line) { spdlog::info("scenario: {}", line); });
  simulate({plant, body, world, *buses, player, robot.buses.size(), pacer}, stop, [&](MonoTime now) {
    if (observer) observer->look(*body, player, pacer, now);
  });
  spdlog::info("ending after {} skipped steps", pacer.skipped());
  if (!world || !world->end()) return 0;
  return world->end()->kind == WorldEndKind::succeeded ? 0 : refuse(kExitUnavailable, world->end()->sentence);
}

std::vector<double> payloads_of(const Scenario& scenario) {
  std::vector<double> payloads;
  for (const FaultEvent& event : scenario.events)
    if (event.kind == FaultKind::payload) payloads.push_back(event.dose);
  return payloads;
}

// The scenario's events that reach into the mechanics, which are the world's own. Empty: none.
std::string beyond_reach(const Scenario& scenario, const std::string& file, const WorldLink& link) {
  for (const FaultEvent& event : scenario.events)
    if (event.kind == FaultKind::payload || (event.kind == FaultKind::push && !link.gives(TAKT_WORLD_PUSH)))
      return file + ": " + text_of(event) + " is not for --world, whose mechanics are its own; play it there";
  return {};
}

int serve_in_world(const Options& options, const config::RobotConfig& robot, Scenario scenario) {
  if (!robot.simulation)
    return refuse(config::kExitBadConfiguration, robot.file + ": no `simulation`: --world needs it");
  auto world = OutsideMechanics::connect(robot, options.world, robot.simulation->seed);
  if (!world) return refuse(kExitUnavailable, world.error().sentence);
  OutsideMechanics& played = **world;  // the plant's
  if (const std::string why = beyond_reach(scenario, options.scenario, played.link()); !why.empty())
    return refuse(config::kExitBadConfiguration, why);
  auto body = RobotPlant::make_in(std::move(*world), robot);
  if (!body) return refuse(config::kExitBadConfiguration, body.error());
  spdlog::info("world {} ({}), over {}", options.world, played.link().world(),
               played.link().is_over_shared_memory() ? "shared memory" : "its socket");
  return serve(options, robot, std::move(scenario), *body, &*body, &played);
}

int run(const Options& options) {
  auto robot = options.devices.empty() ? config::load(options.robot) : load_devices(options.devices);
  if (!robot) return refuse(config::kExitBadConfiguration, robot.error());
  if (options.seed && robot->simulation) robot->simulation->seed = *options.seed;
  std::expected<Scenario, std::string> scenario;
  if (!options.scenario.empty()) scenario = load_scenario(options.scenario, *robot);
  if (!scenario) return refuse(config::kExitBadConfiguration, scenario.error());
  if (!options.devices.empty()) {
    auto plant = Plant::on_free_inertias(*robot);
    if (!plant) return refuse(config::kExitBadConfiguration, plant.error());
    return serve(options, *robot, std::move(*scenario), *plant, nullptr, nullptr);
  }
  if (!options.world.empty()) return serve_in_world(options, *robot, std::move(*scenario));
  auto body = RobotPlant::make(*robot, payloads_of(*scenario));
  if (!body) return refuse(config::kExitBadConfiguration, body.error());
  for (const FaultEvent& event : scenario->events)
    if (!body->has_body(event.body))
      return refuse(config::kExitBadConfiguration, options.scenario + ": " + text_of(event) +
                                                       ": the robot has no body " + event.body +
                                                       "; name one of its MJCF, or none");
  return serve(options, *robot, std::move(*scenario), *body, &*body, nullptr);
}

}  // namespace
}  // namespace takt::simulation

int main(int argc, char** argv) {
  namespace program = takt::program;
  takt::simulation::Options options;
  CLI::App app(
      "Simulated drives, mechanics and camera of one robot; or drives alone, each on a flywheel.\n"
      "Examples:\n"
      "  takt-plant --robot config/arm6.yaml\n"
      "  takt-plant --robot config/arm6.yaml --scenario config/scenarios/silent_drive.yaml\n"
      "  takt-plant --devices config/devices.yaml");
  auto* const what = app.add_option_group("what to simulate");
  what->add_option("--robot", options.robot, "robot file with `simulation`");
  what->add_option("--devices", options.devices, "devices file (docs/plant-scenarios.md)");
  what->require_option(1);
  app.add_option("--scenario", options.scenario, "what goes wrong, and when (docs/plant-scenarios.md)");
  app.add_option("--runtime-dir", options.runtime_directory,
                 "where sockets live (default ROBOT or `devices` in $XDG_RUNTIME_DIR/takt, as root /run/takt)");
  app.add_option("--seed", options.seed, "instead of simulation.seed");
  app.add_option("--world", options.world,
                 "--robot: socket of the process that plays its mechanics (docs/world-protocol.md)")
      ->excludes("--devices");
  app.add_option("--truth", options.truth_file, "--robot: write what the robot really did to this file, as JSON lines")
      ->excludes("--devices");
  app.add_option("--target-entry", options.target_entry_s, "s, how far along its path the camera's target begins")
      ->check(CLI::Range(0.0, 1e6));
  program::add_policy_user(app, options, "may read the camera");
  app.add_flag("--on-hardware", options.on_hardware,
               "speak on real CAN interfaces too, in place of the drives; default: only on virtual and loopback ones");
  app.add_flag("--debug", options.debug, "log the distance to the target once per second");
  app.footer(
      "Exit codes: 0 ended by a signal, 64 command line, 65 robot, devices or scenario file refused, 69 a bus or\n"
      "socket is not to be had, or the world of --world ended, 70 bug.");
  if (const auto ended = program::parse(app, argc, argv)) return *ended;
  return program::run("takt-plant", [&] {
    if (options.debug) spdlog::set_level(spdlog::level::debug);
    return takt::simulation::run(options);
  });
}
