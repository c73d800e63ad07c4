// SPDX-License-Identifier: Apache-2.0
// Any bytes as ticks.mcap: what is damaged is left out and counted, what is whole is decoded; never a crash, and no
// more memory or time than the bytes can pay for. Each message goes through every decoder, and each schema's text
// through the relayout that old runs need.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

#include "monitor/record/image_message.hpp"
#include "monitor/record/mcap_reader.hpp"
#include "monitor/record/message_schema.hpp"
#include "monitor/record/policy_input_message.hpp"
#include "monitor/record/run_messages.hpp"
#include "monitor/record/tick_schema.hpp"
#include "tests/fuzz/refused_with_a_sentence.hpp"
#include "tests/fuzz/scratch.hpp"

namespace {

using namespace takt::monitor;

void decode(std::span<const std::byte> message) {
  static RecordedTick tick;
  RecordedCommand command;
  RecordedKeyframe keyframe;
  RecordedPolicyInput input;
  ShownImage image;
  Loss loss;
  decode_tick(message, tick);
  if (decode_command(message, command)) header_of(command);
  decode_keyframe(message, keyframe);
  decode_policy_input(message, input);
  decode_image(message, image);
  decode_loss(message, loss);
  read_policy_input(message);
}

void lay_out_anew(std::string_view schema, std::span<const std::byte> message) {
  const auto from = message_schema_of(schema);
  const auto to = message_schema_of(tick_schema());
  if (!from || !to) return;
  if (auto relayout = Relayout::make(*from, *to)) (*relayout)(message);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::string path = takt::fuzz::scratch_folder() + "/ticks.mcap";
  const std::span content(data, size);
  decode(std::as_bytes(content));
  takt::fuzz::write_file(path, content);
  const auto reader = McapReader::open(path);
  takt::fuzz::check_refusal(reader);
  if (!reader) return 0;
  int left = 64;
  reader->scan([&left](const McapMessage& message) {
    decode(message.data);
    if (left % 16 == 0) lay_out_anew(message.schema, message.data);
    return --left > 0;
  });
  return 0;
}
