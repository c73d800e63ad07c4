// SPDX-License-Identifier: Apache-2.0
// make_policy_inputs DIR: a recorded run with four inputs of a policy, without samples of outside sensors and with, the
// same ones twice, one of a person who said nothing, and one input of a client that was shown images; an IMU with a new
// sample every fourth tick; and DIR/inputs.json, what was written, for readers in other languages.
#include <cstdio>
#include <exception>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "config/load.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/image_file.hpp"
#include "monitor/record/image_store.hpp"
#include "monitor/record/recorder.hpp"
#include "tests/monitor/record/virtual_robot.hpp"

namespace takt::monitor {
namespace {

using Json = nlohmann::ordered_json;

std::vector<float> floats(std::size_t count, float from) {
  std::vector<float> values(count);
  for (float& value : values) value = from += 0.1F;
  return values;
}

RecordedPolicyInput input_with(std::uint32_t samples) {
  PolicyInput input;
  input.header = {.observation_id = 100 + samples, .sequence = 200 + samples, .inference = 300 + samples};
  input.header.policy_hash = VirtualRobot::kPolicyHash;
  input.header.after_reset = samples == 1 ? 1 : 0;
  input.header.built_in = 1;
  for (std::uint32_t sample = 0; sample < samples; ++sample) {
    const auto stamp = static_cast<std::int64_t>(1000 * samples + sample);
    const std::uint32_t values = sample == 1 ? 0 : 2 + sample;  // one of them has none
    input.samples.push_back(
        {sample == 2 ? UINT64_MAX : 10 + sample, MonoTime{stamp}, MonoTime{stamp + 1}, sample, values});
    const auto of_it = floats(values, static_cast<float>(sample));
    input.sample_values.insert(input.sample_values.end(), of_it.begin(), of_it.end());
  }
  input.joints[0] = floats(6, -1.0F);
  input.header.quantities = 1;
  input.header.joint_count = 6;
  input.header.sample_count = samples;
  input.header.following = samples;
  input.header.committed_from = 2;
  input.header.committed_count = 3;
  if (samples == 1) {
    input.header.by_client = 1;
    input.header.built_in = 0;
    input.header.quantities = 1 + 8;
    input.joints[3] = floats(6, 2.0F);
    input.samples[0].value_count = 0;
    input.sample_values.clear();
  } else {
    input.input = floats(5 + samples, static_cast<float>(samples));
    input.output = floats(12, 7.0F);
  }
  input.header.input_count = static_cast<std::uint32_t>(input.input.size());
  input.header.output_count = static_cast<std::uint32_t>(input.output.size());
  RecordedPolicyInput recorded{samples == 3 ? Player::fallback : Player::policy, std::move(input), 0};
  recorded.crc = crc_of(recorded.input);
  return recorded;
}

Json told(const RecordedPolicyInput& recorded) {
  const PolicyInput& input = recorded.input;
  Json json = {{"observation_id", input.header.observation_id},
               {"sequence", input.header.sequence},
               {"inference", input.header.inference},
               {"policy_hash", input.header.policy_hash},
               {"following", input.header.following},
               {"committed_from", input.header.committed_from},
               {"committed_count", input.header.committed_count},
               {"q", input.joints[0]},
               {"dq", input.joints[1]},
               {"tau", input.joints[2]},
               {"q_setpoint", input.joints[3]},
               {"dq_of_drive", input.joints[4]},
               {"input", input.input},
               {"output", input.output},
               {"after_reset", input.header.after_reset != 0},
               {"built_in", input.header.built_in != 0},
               {"by_client", input.header.by_client != 0},
               {"sender", name(recorded.sender)},
               {"crc", recorded.crc}};
  for (const char* list :
       {"sample_sensor", "sample_sequence", "sample_sensed_at", "sample_published_at", "sample_values"})
    json[list] = Json::array();
  auto value = input.sample_values.begin();
  for (const PolicyInputSample& sample : input.samples) {
    json["sample_sensor"].push_back(sample.sensor);
    json["sample_sequence"].push_back(sample.sequence);
    json["sample_sensed_at"].push_back(sample.sensed_at.ns);
    json["sample_published_at"].push_back(sample.published_at.ns);
    json["sample_values"].push_back(std::vector<float>(value, value + sample.value_count));
    value += sample.value_count;
  }
  return json;
}

template <class Value>
Value required(std::expected<Value, std::string> value) {
  if (!value) throw std::runtime_error(value.error());
  if constexpr (!std::is_void_v<Value>) return std::move(*value);
}

// What was shown to the client, kept, and another image for which there was no room.
Json images_of(const RecordedPolicyInput& recorded, const RunFolder& folder, const RecordSink& sink) {
  const config::ImageShape shape{3, 4, 3};
  std::vector<std::byte> pixels(shape.bytes());
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<std::byte>(7 * i);
  const PolicyInputSample& sample = recorded.input.samples.at(0);
  ShownImage image{.sequence = sample.sequence,
                   .sensed_at = sample.sensed_at,
                   .published_at = sample.published_at,
                   .sensor = sample.sensor,
                   .shape = shape,
                   .file = ImageFile::unseen,
                   .sha256 = {}};
  const std::string content = image_file(shape, pixels);
  image.sha256 = config::sha256_hex(content);
  ImageStore store(folder, {.budget_mib = static_cast<double>(content.size()) / (1U << 20U), .rate_mib_per_s = 1});
  image.file = store.keep(image, content, MonoTime{1});
  sink.image(image);
  const std::string kept = image.sha256;
  ++image.sequence;
  pixels[0] = std::byte{1};
  image.sha256 = config::sha256_hex(image_file(shape, pixels));
  image.file = store.keep(image, image_file(shape, pixels), MonoTime{2});
  sink.image(image);
  Json values = Json::array();
  for (std::size_t i = 0; i < shape.bytes(); ++i) values.push_back(7 * i % 256);
  return {{"kept", kept}, {"not_kept", image.sha256}, {"shape", {3, 4, 3}}, {"bytes", values}};
}

void make(const std::string& directory) {
  VirtualRobot robot;
  const RunFolder folder = required(RunFolder::create(directory));
  auto recorder = required(Recorder::start(folder, robot.manifest(), demo_robot()));
  auto stream = required(RecordStream::attach(robot.rings(), demo_robot().joints.size()));
  robot.spoil_input = [](pipeline::TickInput& read) {
    read.imu.sequence = read.tick / 4;
    read.imu.sensed_at = MonoTime{static_cast<std::int64_t>(100 * read.imu.sequence)};
    for (std::size_t axis = 0; axis < 3; ++axis)
      read.imu.acceleration[axis] = static_cast<float>(read.imu.sequence) + 0.25F * static_cast<float>(axis);
  };
  robot.run(50);
  Json all = Json::array(), shown;
  for (const std::uint32_t samples : {0U, 1U, 3U, 3U}) {
    stream.drain(recorder->sink(), false);
    const RecordedPolicyInput input = input_with(samples);
    recorder->sink().policy_input(input);
    all.push_back(told(input));
    if (samples == 1) shown = images_of(input, folder, recorder->sink());
  }
  stream.drain(recorder->sink(), true);
  required(recorder->finish(robot.latest().header.now, "test over"));
  required(replace_file(directory + "/inputs.json", all.dump()));
  required(replace_file(directory + "/images.json", shown.dump()));
}

}  // namespace
}  // namespace takt::monitor

int main(int argc, char** argv) {
  if (argc != 2) return 64;
  try {
    takt::monitor::make(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_policy_inputs: %s\n", error.what());
    return 1;
  }
  return 0;
}
