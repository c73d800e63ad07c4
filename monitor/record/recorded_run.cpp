#include "monitor/record/recorded_run.hpp"

#include <fmt/format.h>

#include "config/load.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::monitor {

std::expected<RecordedRun, std::string> open_run(const std::string& directory) {
  RecordedRun run{RunFolder(directory), {}, {}};
  auto manifest = run.folder.read_manifest();
  if (!manifest) return std::unexpected(manifest.error());
  run.manifest = std::move(*manifest);
  const auto text = read_file(run.folder.config());
  if (!text) return std::unexpected(text.error());
  if (const std::string found = config::sha256_hex(*text); found != run.manifest.config_sha256) {
    return std::unexpected(fmt::format("{} was altered: its SHA-256 is {}, the manifest says {}", run.folder.config(),
                                       found, run.manifest.config_sha256));
  }
  // The manifest of a recording that was cut off is older than the cards.
  if (const auto cards = read_file(run.folder.drives()))
    if (auto json = nlohmann::ordered_json::parse(*cards, nullptr, false); json.is_object())
      run.manifest.drives = std::move(json);
  auto robot = config::parse(*text, run.folder.config());
  if (!robot) return std::unexpected(robot.error());
  run.robot = std::move(*robot);
  return run;
}

namespace {

// Hands one message on; false when it is not what its topic says.
bool visit(const McapMessage& message, const RunVisitor& visitor, RecordedTick& tick) {
  if (message.topic == topic_name(Topic::tick)) {
    if (!visitor.tick) return true;
    if (!decode_tick(message.data, tick)) return false;
    visitor.tick(tick);
  } else if (message.topic == topic_name(Topic::command)) {
    if (!visitor.command) return true;
    RecordedCommand command;
    if (!decode_command(message.data, command)) return false;
    visitor.command(command);
  } else if (message.topic == topic_name(Topic::keyframe)) {
    if (!visitor.keyframe) return true;
    RecordedKeyframe keyframe;
    if (!decode_keyframe(message.data, keyframe)) return false;
    visitor.keyframe(keyframe);
  } else if (message.topic == topic_name(Topic::loss)) {
    if (!visitor.loss) return true;
    Loss loss;
    if (!decode_loss(message.data, loss)) return false;
    visitor.loss(loss);
  } else if (message.topic == topic_name(Topic::policy_input)) {
    if (!visitor.policy_input) return true;
    RecordedPolicyInput input;
    if (!decode_policy_input(message.data, input)) return false;
    visitor.policy_input(input);
  } else if (message.topic == topic_name(Topic::image)) {
    if (!visitor.image) return true;
    ShownImage image;
    if (!decode_image(message.data, image)) return false;
    visitor.image(image);
  }
  return true;
}

}  // namespace

std::expected<ScanReport, std::string> scan_run(const RecordedRun& run, const RunVisitor& visitor) {
  const auto reader = McapReader::open(run.folder.ticks());
  if (!reader) return std::unexpected(reader.error());
  ScanReport report;
  RecordedTick tick;
  report.file = reader->scan([&](const McapMessage& message) {
    if (!visit(message, visitor, tick)) ++report.undecodable;
    return true;
  });
  return report;
}

}  // namespace takt::monitor
