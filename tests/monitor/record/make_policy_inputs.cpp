// make_policy_inputs DIR: a recorded run with three inputs of a policy, without samples of outside sensors and with;
// and DIR/inputs.json, what was written, for readers in other languages.
#include <cstdio>
#include <exception>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "monitor/record/bounded_file.hpp"
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
    input.samples.push_back({10 + sample, MonoTime{stamp}, MonoTime{stamp + 1}, sample, values});
    const auto of_it = floats(values, static_cast<float>(sample));
    input.sample_values.insert(input.sample_values.end(), of_it.begin(), of_it.end());
  }
  input.q = floats(6, -1.0F);
  input.input = floats(5 + samples, static_cast<float>(samples));
  input.output = floats(12, 7.0F);
  input.header.joint_count = 6;
  input.header.sensor_count = samples;
  input.header.input_count = static_cast<std::uint32_t>(input.input.size());
  input.header.output_count = 12;
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
               {"q", input.q},
               {"input", input.input},
               {"output", input.output},
               {"after_reset", input.header.after_reset != 0},
               {"built_in", input.header.built_in != 0},
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

void make(const std::string& directory) {
  VirtualRobot robot;
  const RunFolder folder = required(RunFolder::create(directory));
  auto recorder = required(Recorder::start(folder, robot.manifest(), demo_robot(), kDefaultMaxFileBytes));
  auto stream = required(RecordStream::attach(robot.rings(), demo_robot().joints.size()));
  robot.run(50);
  Json all = Json::array();
  for (const std::uint32_t samples : {0U, 1U, 3U}) {
    stream.drain(recorder->sink(), false);
    const RecordedPolicyInput input = input_with(samples);
    recorder->sink().policy_input(input);
    all.push_back(told(input));
  }
  stream.drain(recorder->sink(), true);
  required(recorder->finish(robot.latest().header.now, "test over"));
  required(replace_file(directory + "/inputs.json", all.dump()));
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
