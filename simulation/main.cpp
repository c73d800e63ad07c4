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
#include <cstring>
#include <functional>
#include <optional>
#include <vector>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/image_sample.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/sensor_server.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "executive/log/program_log.hpp"
#include "simulation/camera.hpp"
#include "simulation/chance.hpp"
#include "simulation/devices_file.hpp"
#include "simulation/outside_mechanics.hpp"
#include "simulation/pacer.hpp"
#include "simulation/plant_buses.hpp"
#include "simulation/robot_plant.hpp"
#include "simulation/scenario_player.hpp"
#include "simulation/sensor_path.hpp"
#include "simulation/truth_log.hpp"

namespace takt::plant {
namespace {

constexpr int kExitUsage = 64, kExitUnavailable = 69, kExitInternal = 70;
constexpr int kPriority = 10;  // SCHED_FIFO
constexpr Duration kTruthPeriod = milliseconds(10);
constexpr Duration kReportPeriod = seconds(1);
constexpr std::uint64_t kSensorPathStream = 201;

struct Options {
  std::string robot, devices, scenario, runtime_directory, truth_file, policy_user, world;
  std::optional<std::uint64_t> seed;
  double target_entry_s = 0;
  bool on_hardware = false, debug = false;
};

std::atomic<bool> g_stop = false;
static_assert(std::atomic<bool>::is_always_lock_free);

void stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { g_stop = true; };
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGINT, &action, nullptr);
}

int refuse(int exit_code, const std::string& sentence) {
  std::fprintf(stderr, "%s\n", sentence.c_str());
  return exit_code;
}

// Drives and arms do not wait for a CPU: their double should not either. Far below the executive; the work per turn is
// bounded. Calling thread only.
void ask_for_punctuality() {
  ::prctl(PR_SET_TIMERSLACK, 1'000UL);  // ns; the default of 50 us is a twentieth of a step
  const sched_param wanted{.sched_priority = kPriority};
  if (::sched_setscheduler(0, SCHED_FIFO, &wanted) != 0)
    spdlog::info("no real-time priority to be had: on a busy machine the simulated drives will answer late");
}

void publish(ipc::SensorServer& server, const Sensed& sensed) {
  const auto& [sample, pixels] = sensed;
  if (!pixels) return server.publish(sample);
  const ImageHeader header{sample.sequence, sample.sensed_at, sample.published_at,
                           static_cast<std::uint32_t>(pixels->size()), 0};
  const std::span<std::byte> slot = server.begin();
  std::memcpy(slot.data(), &header, sizeof header);
  std::memcpy(slot.data() + sizeof header, pixels->data(), pixels->size());
  server.commit(sizeof header + pixels->size());
}

struct Outputs {
  std::unique_ptr<ipc::SensorServer> sensor, imu, of_world;
  std::vector<std::unique_ptr<ipc::SensorServer>> images;  // one per sensor of the robot file; null: not the world's
  std::optional<TruthLog> truth;
};

// What happens beside a robot's simulation: camera samples, the truth file, a line per second.
class Observer {
 public:
  // `started`: when the target was at the beginning of its path. `world`: that plays the robot; null: none.
  Observer(const config::Simulation& simulation, MonoTime started, OutsideMechanics* world, Outputs outputs)
      : simulation_(simulation),
        world_(world),
        started_(started),
        camera_(simulation, started),
        path_(seed_for(simulation.seed, kSensorPathStream)),
        outputs_(std::move(outputs)),
        next_truth_(monotonic_now()),
        next_report_(next_truth_) {}

  void look(RobotPlant& body, const SensorFaults& faults, const Pacer& pacer, MonoTime now) {
    if (outputs_.sensor) {
      if (const auto sample = camera_.poll(now)) path_.take({*sample}, faults);
      while (const auto sensed = path_.deliver(now)) publish(*outputs_.sensor, *sensed);
    }
    if (outputs_.imu) publish_imu(body, now);
    if (outputs_.of_world)
      if (const auto sample = world_->sample(now)) outputs_.of_world->publish(*sample);
    if (!outputs_.images.empty())
      for (const auto& [sensor, sensed] : world_->images(now)) publish(*outputs_.images[sensor], sensed);
    if (outputs_.truth && now >= next_truth_) {
      next_truth_ = now + kTruthPeriod;
      outputs_.truth->write(truth_of(body, now));
    }
    if (now < next_report_) return;
    next_report_ = now + kReportPeriod;
    if (outputs_.truth) outputs_.truth->flush();
    spdlog::debug("{:.1f} mm from the target, {} steps skipped", 1e3 * tool_error(truth_of(body, now)),
                  pacer.skipped());
  }

 private:
  void publish_imu(RobotPlant& body, MonoTime now) {
    const auto reading = body.imu();
    if (!reading) return;
    outputs_.imu->publish(imu_sample(*reading, ++imu_samples_, now));
  }
  [[nodiscard]] Truth truth_of(RobotPlant& body, MonoTime now) const {
    return {now, body.state(), body.controlled_point(), target_at(simulation_, now - started_)};
  }

  const config::Simulation& simulation_;
  OutsideMechanics* world_;
  MonoTime started_;
  Camera camera_;
  SensorPath path_;
  Outputs outputs_;
  std::uint64_t imu_samples_ = 0;
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

void simulate(const Stage& stage, const std::function<void(MonoTime)>& observe) {
  while (!g_stop && !(stage.world && stage.world->end())) {
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

// `plays_imu`: the mechanics have an IMU; otherwise a process of the user's plays it. `world`: null: there is none. Its
// sensor takes the camera's place too.
std::expected<Outputs, std::string> open_outputs(const config::RobotConfig& robot, const std::string& directory,
                                                 const Options& options, bool plays_imu,
                                                 const OutsideMechanics* world) {
  const std::string world_sensor = world != nullptr ? world->link().sensor() : "";
  Outputs outputs;
  std::optional<uid_t> policy_user;
  if (!options.policy_user.empty()) {
    const auto user = ipc::user_id(options.policy_user);
    if (!user) return std::unexpected("--policy-user: " + user.error());
    policy_user = *user;
  }
  if (!world_sensor.empty()) {
    auto sensor = ipc::SensorServer::start(config::sensor_socket(directory, world_sensor), policy_user);
    if (!sensor) return std::unexpected(sensor.error());
    outputs.of_world = std::move(*sensor);
  }
  for (std::size_t i = 0; world != nullptr && i < robot.sensors.size(); ++i) {
    if (!world->films(i)) continue;
    const auto& [height, width, channels] = *robot.sensors[i].image;
    auto sensor = ipc::SensorServer::start(config::sensor_socket(directory, robot.sensors[i].name), policy_user,
                                           ipc::image_mailbox(height, width, channels));
    if (!sensor) return std::unexpected(sensor.error());
    outputs.images.resize(robot.sensors.size());
    outputs.images[i] = std::move(*sensor);
  }
  if (!robot.simulation->camera_sensor.empty() && robot.simulation->camera_sensor != world_sensor) {
    auto sensor =
        ipc::SensorServer::start(config::sensor_socket(directory, robot.simulation->camera_sensor), policy_user);
    if (!sensor) return std::unexpected(sensor.error());
    outputs.sensor = std::move(*sensor);
  }
  if (robot.imu && plays_imu) {
    auto imu = ipc::SensorServer::start(config::sensor_socket(directory, robot.imu->sensor), policy_user);
    if (!imu) return std::unexpected(imu.error());
    outputs.imu = std::move(*imu);
  }
  if (!options.truth_file.empty()) {
    auto truth = TruthLog::create(options.truth_file);
    if (!truth) return std::unexpected(truth.error());
    outputs.truth = std::move(*truth);
  }
  return outputs;
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
  const std::string directory =
      options.runtime_directory.empty() ? config::default_runtime_directory(robot.robot) : options.runtime_directory;
  stop_on_signals();
  auto outputs = open_outputs(robot, directory, options, body != nullptr && body->imu().has_value(), world);
  if (!outputs) return refuse(kExitUnavailable, outputs.error());
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
  const MonoTime started = monotonic_now();
  const Duration entered{std::llround(options.target_entry_s * 1e9)};
  Observer observer(*robot.simulation, started - entered, world, std::move(*outputs));
  Pacer pacer(plant.step_length(), started + plant.step_length());
  ScenarioPlayer player(std::move(scenario), robot.buses.size(),
                        [](const std::string& line) { spdlog::info("scenario: {}", line); });
  simulate({plant, body, world, *buses, player, robot.buses.size(), pacer}, [&](MonoTime now) {
    if (body) observer.look(*body, player.on_sensor(), pacer, now);
  });
  spdlog::info("ending after {} skipped steps", pacer.skipped());
  if (!world || !world->end()) return 0;
  return world->end()->kind == WorldEndKind::succeeded ? 0 : refuse(kExitUnavailable, world->end()->sentence);
}

std::vector<double> payloads_of(const Scenario& scenario) {
  std::vector<double> payloads;
  for (const FaultEvent& event : scenario.events)
    if (event.kind == FaultKind::payload) payloads.push_back(event.amount);
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
}  // namespace takt::plant

int main(int argc, char** argv) {
  takt::plant::Options options;
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
  app.add_option("--policy-user", options.policy_user, "a user who may read the camera; default: ours only");
  app.add_flag("--on-hardware", options.on_hardware,
               "speak on real CAN interfaces too, in place of the drives; default: only on virtual and loopback ones");
  app.add_flag("--debug", options.debug, "log the distance to the target once per second");
  app.set_version_flag("--version", TAKT_VERSION);
  app.footer(
      "Exit codes: 0 ended by a signal, 64 command line, 65 robot, devices or scenario file refused, 69 a bus or\n"
      "socket is not to be had, or the world of --world ended, 70 bug.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : takt::plant::kExitUsage;
  }
  try {
    takt::log::log_to_stderr("takt-plant");
    if (options.debug) spdlog::set_level(spdlog::level::debug);
    return takt::plant::run(options);
  } catch (const std::exception& error) {
    return takt::plant::refuse(takt::plant::kExitInternal, std::string("internal error: ") + error.what());
  }
}
