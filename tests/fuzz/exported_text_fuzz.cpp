// SPDX-License-Identifier: Apache-2.0
// Any text as what other programs, or a user beside the robot file, write: deploy.yaml, a LEAPP bundle and the
// values beside it, a scenario, a file of devices, XML. Refused with a sentence, or read.
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "config/deploy_file.hpp"
#include "config/load.hpp"
#include "config/xml_tags.hpp"
#include "policy_host/leapp/initial_values.hpp"
#include "policy_host/leapp/leapp_bundle.hpp"
#include "simulation/devices_file.hpp"
#include "simulation/scenario.hpp"
#include "tests/fuzz/refused_with_a_sentence.hpp"
#include "tests/fuzz/scratch.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using takt::fuzz::judge;
  static const takt::config::RobotConfig robot = takt::config::load("config/arm6.yaml").value();
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  judge(takt::config::read_deploy_file(text, "fuzz"));
  if (takt::policy_host::is_leapp_bundle(text)) judge(takt::policy_host::read_leapp_bundle(text, "fuzz"));
  judge(takt::simulation::parse_scenario(text, "fuzz", robot));
  judge(takt::simulation::parse_devices(text, "fuzz"));
  static const std::string values = takt::fuzz::scratch_folder() + "/values.safetensors";
  takt::fuzz::write_file(values, {data, size});
  takt::fuzz::check_refusal(takt::policy_host::read_initial_values(values));
  std::size_t from = 0;
  while (const auto tag = takt::config::next_tag(text, from)) {
    if (tag->end <= from) __builtin_trap();  // it would look for ever
    from = tag->end;
  }
  return 0;
}
