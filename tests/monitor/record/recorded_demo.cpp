// SPDX-License-Identifier: Apache-2.0
#include "tests/monitor/record/recorded_demo.hpp"

#include <filesystem>
#include <stdexcept>

#include "monitor/record/mcap_writer.hpp"

namespace takt::monitor {
namespace {

template <class Value>
Value required(std::expected<Value, std::string> value) {
  if (!value) throw std::runtime_error(value.error());
  return std::move(*value);
}

}  // namespace

RecordedRun record(VirtualRobot& robot, const std::string& directory, std::uint64_t ticks,
                   const std::function<void(std::uint64_t tick)>& before) {
  const RunFolder folder = required(RunFolder::create(directory));
  auto recorder = required(Recorder::start(folder, robot.manifest(), demo_robot()));
  auto stream = required(RecordStream::attach(robot.rings(), demo_robot().joints.size()));
  for (std::uint64_t tick = 0; tick < ticks; tick += 20) {
    before(tick);
    robot.run(20);
    stream.drain(recorder->sink(), false);
    recorder->flush_if_due(robot.latest().header.now);
  }
  stream.drain(recorder->sink(), true);
  if (auto done = recorder->finish(robot.latest().header.now, "test over"); !done)
    throw std::runtime_error(done.error());
  return required(open_run(directory));
}

RecordedRun record_demo(const std::string& directory) {
  VirtualRobot robot;
  robot.mark_at = kDemoMark;
  return record(robot, directory, kDemoTicks,
                [&](std::uint64_t tick) { robot.policy_is_frozen = (tick >= 1'500 && tick < 1'900) || tick >= 3'000; });
}

RecordedRun altered_copy(const RecordedRun& run, const std::string& directory,
                         const std::function<void(TickRecord&)>& alter_tick,
                         const std::function<void(RecordedCommand&)>& alter_command,
                         const std::function<bool(std::uint64_t tick)>& keep_tick, Checksums checksums,
                         const std::vector<ShownImage>& images) {
  const bool anew = checksums == Checksums::made_anew;
  const RunFolder folder = required(RunFolder::create(directory));
  for (const char* file : {"config.yaml", "manifest.json"}) {
    std::filesystem::copy_file(run.folder.path() + "/" + file, directory + "/" + file);
  }
  auto writer = required(McapWriter::create(folder.ticks(), 1U << 30U, run_topics(), {}));
  CdrWriter message;
  const auto write = [&](Topic topic) { writer.write(static_cast<std::uint16_t>(topic), 1, message.bytes()); };
  (void)required(scan_run(run, {.tick =
                                    [&](const RecordedTick& tick) {
                                      if (!keep_tick(tick.record.header.tick)) return;
                                      TickRecord record = tick.record;
                                      alter_tick(record);
                                      encode_tick(record, anew ? crc_of(record) : tick.crc, message);
                                      write(Topic::tick);
                                    },
                                .command =
                                    [&](const RecordedCommand& command) {
                                      RecordedCommand copy = command;
                                      alter_command(copy);
                                      if (anew) copy.crc = crc_of(copy);
                                      encode_command(copy, message);
                                      write(Topic::command);
                                    },
                                .keyframe =
                                    [&](const RecordedKeyframe& keyframe) {
                                      encode_keyframe(keyframe, message);
                                      write(Topic::keyframe);
                                    },
                                .loss = {}}));
  for (const ShownImage& image : images) {
    encode_image(image, message);
    write(Topic::image);
  }
  writer.finish();
  return required(open_run(directory));
}

}  // namespace takt::monitor
