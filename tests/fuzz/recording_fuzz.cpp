// SPDX-License-Identifier: Apache-2.0
// Any bytes as ticks.mcap: what is damaged is left out and counted, what is whole is decoded; never a crash, and no
// more memory or time than the bytes can pay for. Each message goes through every decoder, and each schema's text
// through the relayout that old runs need.
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

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

namespace {

using namespace takt::monitor;

std::string scratch_file() {
  std::string path = "/dev/shm/takt-recording-fuzz-XXXXXX";
  const int file = ::mkstemp(path.data());
  if (file < 0) std::abort();
  ::close(file);
  static std::string kept = path;
  std::atexit([] { ::unlink(kept.c_str()); });
  return path;
}

void write_file(const std::string& path, std::span<const std::uint8_t> content) {
  const int file = ::open(path.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
  if (file < 0 || ::write(file, content.data(), content.size()) != static_cast<ssize_t>(content.size())) std::abort();
  ::close(file);
}

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
  static const std::string path = scratch_file();
  const std::span content(data, size);
  decode(std::as_bytes(content));
  write_file(path, content);
  const auto reader = McapReader::open(path);
  if (!reader) {
    if (reader.error().empty()) std::abort();
    return 0;
  }
  int left = 64;
  reader->scan([&left](const McapMessage& message) {
    decode(message.data);
    if (left % 16 == 0) lay_out_anew(message.schema, message.data);
    return --left > 0;
  });
  return 0;
}
