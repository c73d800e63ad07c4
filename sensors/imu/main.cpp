// takt-imu: an Xsens MTi on a serial port, as the IMU of a robot.
// Exit codes: 0 ended by a signal, 64 usage, 65 robot file refused, 69 another process serves the sensor, 70 internal.
#include <fmt/format.h>
#include <poll.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <array>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "config/units.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/sensor_server.hpp"
#include "executive/log/program_log.hpp"
#include "sensors/complaint.hpp"
#include "sensors/imu/imu_reading.hpp"
#include "sensors/imu/mtdata2.hpp"
#include "sensors/imu/serial_port.hpp"

namespace takt::sensors {
namespace {

constexpr int kExitUsage = 64, kExitUnavailable = 69, kExitInternal = 70;
constexpr Duration kRetry = milliseconds(500);
constexpr Duration kSilence = seconds(1);  // longer, and a person is told
constexpr Duration kReportPeriod = seconds(1);

struct Options {
  std::string robot, port, runtime_directory;
  std::vector<std::string> rpy{"0 rad", "0 rad", "0 rad"};
  std::uint32_t baud = 115'200;
};

std::atomic<bool> g_stop = false;
static_assert(std::atomic<bool>::is_always_lock_free);

// They come while it waits for bytes, and at no other time. Returns the mask to wait with.
sigset_t stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { g_stop = true; };
  sigset_t ours, before;
  sigemptyset(&ours);
  for (const int number : {SIGTERM, SIGINT}) {
    sigaction(number, &action, nullptr);
    sigaddset(&ours, number);
  }
  pthread_sigmask(SIG_BLOCK, &ours, &before);
  return before;
}

int refuse(int exit_code, const std::string& sentence) {
  std::fprintf(stderr, "takt-imu: %s\n", sentence.c_str());
  return exit_code;
}

// One opening of the port.
class Session {
 public:
  Session(ipc::SensorServer& server, const Quaternion& mounting, const Options& options, Complaint& complaint)
      : server_(server),
        reading_(mounting),
        options_(options),
        complaint_(complaint),
        heard_at_(monotonic_now()),
        reported_at_(heard_at_) {}

  void take(std::span<const std::uint8_t> bytes, std::uint64_t& sequence) {
    const MonoTime now = monotonic_now();
    bytes_ += bytes.size();
    for (const MtMessage& message : stream_.take(bytes, now))
      if (message.id == kMtData2) publish(message, sequence);
    if (now - reported_at_ > kReportPeriod) report(now);
  }
  // Why the port should be opened anew: not every system says that it vanished. Empty: it need not.
  [[nodiscard]] std::string silence() const {
    if (monotonic_now() - heard_at_ <= kSilence) return {};
    if (bytes_ == before_heard_)
      return options_.port + ": nothing comes: is the MTi connected, and in measurement mode?";
    return fmt::format("{}: bytes come, but no MTData2: does the MTi speak at {} baud?", options_.port, options_.baud);
  }

 private:
  void publish(const MtMessage& message, std::uint64_t& sequence) {
    heard_at_ = monotonic_now();
    before_heard_ = bytes_;
    const auto parsed = parse_mtdata2(message.data);
    if (!parsed) complaint_.say(heard_at_, parsed.error());
    if (!parsed) return;
    complaint_.forget();
    if (reading_.counts().samples == 0) spdlog::info("an MTi is heard at {}, {} baud", options_.port, options_.baud);
    auto sample = reading_.take(*parsed, message.first_byte_at);
    if (!sample) return;
    sample->sequence = ++sequence;
    sample->published_at = monotonic_now();
    server_.publish(*sample);
  }
  void report(MonoTime now) {
    reported_at_ = now;
    const ImuCounts& counts = reading_.counts();
    if (counts.lost == reported_.lost && counts.repeated == reported_.repeated &&
        stream_.counts().bad_checksums == reported_bad_)
      return;
    spdlog::warn("of {} samples so far: {} lost, {} repeated; {} messages with a wrong checksum", counts.samples,
                 counts.lost, counts.repeated, stream_.counts().bad_checksums);
    reported_ = counts;
    reported_bad_ = stream_.counts().bad_checksums;
  }

  ipc::SensorServer& server_;
  MtStream stream_;
  ImuReading reading_;
  const Options& options_;
  Complaint& complaint_;
  MonoTime heard_at_, reported_at_;
  std::uint64_t bytes_ = 0, before_heard_ = 0, reported_bad_ = 0;
  ImuCounts reported_;
};

// Until a signal (empty), or there is nothing to hear (why).
std::string listen(SerialPort& port, Session& session, std::uint64_t& sequence, const sigset_t& waiting_mask) {
  std::array<std::uint8_t, 4096> bytes{};
  while (!g_stop) {
    const auto count = port.read(bytes, milliseconds(100), waiting_mask);
    if (!count) return count.error();
    session.take(std::span(bytes).first(*count), sequence);
    if (std::string why = session.silence(); !why.empty()) return why;
  }
  return {};
}

void wait_for_retry(const sigset_t& waiting_mask) {
  const timespec pause{.tv_sec = 0, .tv_nsec = kRetry.ns};
  ::ppoll(nullptr, 0, &pause, &waiting_mask);
}

int serve(const Options& options, const Quaternion& mounting, ipc::SensorServer& server) {
  const sigset_t waiting_mask = stop_on_signals();
  Complaint complaint;
  std::uint64_t sequence = 0;
  while (!g_stop) {
    auto port = SerialPort::open(options.port, options.baud);
    if (port) {
      Session session(server, mounting, options, complaint);
      const std::string why = listen(*port, session, sequence, waiting_mask);
      if (!why.empty()) complaint.say(monotonic_now(), why);
    } else {
      complaint.say(monotonic_now(), port.error());
    }
    if (!g_stop) wait_for_retry(waiting_mask);
  }
  return 0;
}

std::expected<Quaternion, std::string> mounting_of(const Options& options) {
  config::Vector3 rpy{};
  for (std::size_t i = 0; i < rpy.size(); ++i) {
    const auto angle = config::parse_quantity(options.rpy[i], config::Dimension::angle);
    if (!angle) return std::unexpected("--rpy: " + angle.error());
    rpy[i] = *angle;
  }
  return rotation_of(rpy);
}

int run(const Options& options) {
  if (!is_known_baud(options.baud))
    return refuse(kExitUsage, fmt::format("--baud: {} is none of {}", options.baud, known_bauds()));
  const auto mounting = mounting_of(options);
  if (!mounting) return refuse(kExitUsage, mounting.error());
  const auto robot = config::load(options.robot);
  if (!robot) return refuse(config::kExitBadConfiguration, robot.error());
  if (!robot->imu)
    return refuse(config::kExitBadConfiguration,
                  robot->file + ": the robot has no `imu`: add it, and its sensor (docs/sensors.md)");
  const std::string directory =
      options.runtime_directory.empty() ? config::default_runtime_directory(robot->robot) : options.runtime_directory;
  const auto server = ipc::SensorServer::start(config::sensor_socket(directory, robot->imu->sensor));
  if (!server) return refuse(kExitUnavailable, server.error());
  return serve(options, *mounting, **server);
}

}  // namespace
}  // namespace takt::sensors

int main(int argc, char** argv) {
  takt::sensors::Options options;
  CLI::App app(
      "Serves a robot's IMU from an Xsens MTi on a serial port (docs/sensors.md).\n"
      "Example: takt-imu --robot robot.yaml --port /dev/serial/by-id/usb-Xsens-if00-port0 --baud 460800");
  app.add_option("--robot", options.robot, "robot file with `imu`")->required();
  app.add_option("--port", options.port, "serial device; waited for while it is not there")->required();
  app.add_option("--baud", options.baud, "as the MTi is set; default 115200");
  app.add_option("--rpy", options.rpy,
                 "how the sensor sits in the base frame: fixed-axis roll, pitch, yaw (`0 deg,180 deg,0 deg`)")
      ->delimiter(',')
      ->expected(3);
  app.add_option("--runtime-dir", options.runtime_directory,
                 "where sockets live (default ROBOT in $XDG_RUNTIME_DIR/takt, as root /run/takt)");
  app.set_version_flag("--version", TAKT_VERSION);
  app.footer(
      "Exit codes: 0 ended by a signal, 64 command line, 65 robot file refused, 69 another process serves the\n"
      "sensor, 70 bug.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : takt::sensors::kExitUsage;
  }
  try {
    takt::log::log_to_stderr("takt-imu");
    return takt::sensors::run(options);
  } catch (const std::exception& error) {
    return takt::sensors::refuse(takt::sensors::kExitInternal, std::string("internal error: ") + error.what());
  }
}
