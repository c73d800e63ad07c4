// SPDX-License-Identifier: Apache-2.0
// Prints docs/modes.md: what the tick gives each joint in every mode, as it is measured now (mode_situations.hpp), the
// reaction table, what every request does, and rules with their tests (mode_rules.hpp). `mode_page --proofs`: those
// tests, one a line. Exit codes: 0 fine; 1 a situation was not reached, or has no words; 64 command line.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <set>
#include <span>
#include <sstream>
#include <string>

#include "config/key_table.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "tests/docs/mode_rules.hpp"
#include "tests/docs/mode_situations.hpp"

namespace takt::docs {
namespace {

using pipeline::Reaction;
using pipeline::Stop;

constexpr std::array kRules{
    std::span<const Rule>(kUsableRules), std::span<const Rule>(kSilenceRules), std::span<const Rule>(kGivenRules),
    std::span<const Rule>(kStopRules),   std::span<const Rule>(kResetRules),   std::span<const Rule>(kArmRules),
    std::span<const Rule>(kLimitRules),
};

constexpr std::array<std::string_view, 12> kKeys{
    "freshness.max_age",     "freshness.aging_fraction", "freshness.recover_after",
    "freshness.flap_memory", "freshness.stop_after",     "degraded.behaviour",
    "degraded.speed_scale",  "degraded.resume_over",     "degraded.after",
    "degraded.for",          "stops.NAME.how",           "feedback.rest_velocity",
};

void print_head() {
  fmt::print(R"(# Modes, stops and resets

What each joint is given in every mode, which cause leads where, and what every request asks, refuses and does.

Made by `build/release/bin/mode_page >docs/modes.md`.
The tables of joints, requests, instants and limits are measured: the tick is run into each situation in virtual time.
The table of causes is the executive's own (`executive/pipeline/mode_machine.hpp`).
`ctest -R docs_modes` measures again, and runs every test that is named here.

```
             arm              enabled            late, violated
  standby ─────────► arming ──────────► tracking ◄────────────► degraded
     ▲                 │                   │      restored          │
     │                 └─────────┬─────────┴────────────────────────┘
     │  reset            stop or │ fault
     └───────────── damped_stop or fault_latched
```

Only an operator leads from `damped_stop` or `fault_latched` to standby: by a reset, or by taking the power.
)");
}

void print_rules(std::span<const Rule> rules) {
  fmt::print("\n| rule | test |\n|---|---|\n");
  for (const Rule& rule : rules) fmt::print("| {} | `{}` |\n", rule.text, rule.proof);
}

void print_situations(const std::vector<Situation>& situations) {
  fmt::print(R"(
## What each joint is given

A joint's torque is `stiffness · (reference − position) + damping · (velocity setpoint − velocity) + gravity + torque`.
Gravity is the model's torque; a robot without a `model` has none.

| mode | when, or which joint | drive | reference | stiffness | damping | gravity | torque |
|---|---|---|---|---|---|---|---|
)");
  for (const auto& [mode, when, given] : situations)
    fmt::print("| {} | {} | {} | {} | {} | {} | {} | {} |\n", mode, when, given.drive, given.reference, given.stiffness,
               given.damping, given.gravity, given.torque);
  print_rules(kGivenRules);
}

std::string_view meaning(std::string_view instant) {
  if (instant == "aging") return "the command is `aging`: usable still";
  if (instant == "stale")
    return "the command is `stale`: each joint brakes, and then stays; the mode is still `tracking`";
  if (instant == "command_late") return "`command_late`: degraded, by `degraded.behaviour`";
  return "`command_lost`: damped stop";
}

void print_silence(const std::vector<Instant>& instants) {
  fmt::print("\n## Usable commands\n");
  print_rules(kUsableRules);
  fmt::print(R"(
## When the policy falls silent

The demo arm (`config/arm6.yaml`), in ticks of 1 ms:

| age of the last command | what happens |
|---|---|
)");
  for (const Instant& instant : instants) fmt::print("| {:.1f} ms | {} |\n", instant.age_ms, meaning(instant.what));
  print_rules(kSilenceRules);
}

// "arming tracking → damped_stop", one target after the other.
std::string leads_to(const Reaction& row) {
  std::string text;
  for (std::size_t to = 0; to < kModeCount; ++to) {
    std::string from;
    for (std::size_t mode = 0; mode < kModeCount; ++mode)
      if (mode != to && row.to.at(mode) == static_cast<Mode>(to))
        from += fmt::format("{}{}", from.empty() ? "" : ", ", name(static_cast<Mode>(mode)));
    if (!from.empty()) text += fmt::format("{}{} → {}", text.empty() ? "" : "; ", from, name(static_cast<Mode>(to)));
  }
  return text;
}

std::string_view power(const Reaction& row) {
  if (row.stops.joints != Stop::none) return "off at the joints it is about";
  switch (row.stops.robot) {
    case Stop::none:
      return "";
    case Stop::category_0:
      return "off";
    case Stop::category_1:
      return "on until rest, then off";
    case Stop::category_2_damping:
      return "on, damping only";
    case Stop::category_2:
      return "on";
  }
  return "";
}

void print_causes() {
  fmt::print(R"(
## Which cause leads where

The gravest cause is first: of all that hold in a tick, the first one that leads on from the present mode decides.
`temperature_high` is told and leads nowhere, unless `degraded.by_temperature` is true; `following_error` likewise,
unless `feedback.following` is `degrade`.
"Clears when" says when a cause no longer blocks arming; a reset asks only for rest and for what "blocks a reset".
What each cause is, and what it leaves to other devices: [hazards.md](hazards.md).

| cause | leads | power | within | blocks a reset | clears when |
|---|---|---|---|---|---|
)");
  std::vector<Reaction> rows(pipeline::kReactions.begin() + 1, pipeline::kReactions.end());
  std::ranges::sort(rows, std::ranges::greater{}, &Reaction::severity);
  for (const Reaction& row : rows)
    fmt::print("| `{}` | {} | {} | {} | {} | {} |\n", name(row.cause), leads_to(row), power(row), row.bound,
               (pipeline::kLastingFaults & pipeline::bit(row.cause)) != 0 ? "yes" : "", row.clears_when);
}

void print_requests(const std::vector<RequestRow>& rows) {
  fmt::print(R"(
## What a request does

The mode one tick after the request, by the mode in which it comes. "not there": the mode is not kept until then.

| request |)");
  for (std::size_t mode = 0; mode < kModeCount; ++mode) fmt::print(" {} |", name(static_cast<Mode>(mode)));
  fmt::print("\n|---|---|---|---|---|---|---|\n");
  for (const RequestRow& row : rows) {
    fmt::print("| {} |", row.request);
    for (const std::string& to : row.leads_to) fmt::print(" {} |", to);
    fmt::print("\n");
  }
}

void print_commands() {
  fmt::print(R"(
### Arm
)");
  print_rules(kArmRules);
  fmt::print(R"(
### Stop and press
)");
  print_rules(kStopRules);
  fmt::print(R"(
### Reset
)");
  print_rules(kResetRules);
  fmt::print(R"(
### Exit codes

| command | 0 | 1 | 69 |
|---|---|---|---|
| `takt arm` | arming | refused: what is missing, one per line | no executive answers |
| `takt stop` | taken, even if no tick read it within 0.1 s; then it prints `the control thread did not answer in time` | | no executive answers; if the stop was handed over all the same, the line says so |
| `takt reset` | in standby | refused: it moves, or what still holds; the robot is armed | no executive answers |

So a script that has to know reads the mode from `takt status --json`, and not the exit code of `takt stop`.
All codes: [exit-codes.md](exit-codes.md).
)");
}

void print_limits(const std::vector<Exceeded>& rows) {
  fmt::print(R"(
## What a limit leads to

| key | exceeded by | cause | mode | every drive keeps its power | test |
|---|---|---|---|---|---|
)");
  for (const Exceeded& row : rows)
    fmt::print("| `{}` | {} | `{}` | {} | {} | `{}` |\n", row.key, row.how, row.cause, row.mode,
               row.keeps_power ? "yes" : "no", row.proof);
  print_rules(kLimitRules);
}

void print_keys() {
  fmt::print("\n## Keys\n\nOf `takt config keys`; all of them: [configuration.md](configuration.md#every-key).\n\n");
  std::istringstream table(config::key_table());
  fmt::print("| key | value | default | meaning |\n|---|---|---|---|\n");
  for (std::string line; std::getline(table, line);)
    if (std::ranges::any_of(kKeys,
                            [&](std::string_view key) { return line.starts_with(fmt::format("| `{}` |", key)); }))
      fmt::print("{}\n", line);
}

int print_page() {
  const auto situations = measure_situations();
  const auto requests = measure_requests();
  const auto silence = measure_silence();
  const auto limits = measure_limits();
  for (const std::string& error : {situations ? "" : situations.error(), requests ? "" : requests.error(),
                                   silence ? "" : silence.error(), limits ? "" : limits.error()})
    if (!error.empty()) {
      fmt::print(stderr, "{}\n", error);
      return 1;
    }
  print_head();
  print_situations(*situations);
  print_silence(*silence);
  print_requests(*requests);
  print_commands();
  print_causes();
  print_limits(*limits);
  print_keys();
  return 0;
}

int print_proofs() {
  std::set<std::string_view> proofs;
  for (const std::span<const Rule> rules : kRules)
    for (const Rule& rule : rules) proofs.insert(rule.proof);
  const auto limits = measure_limits();
  if (!limits) return 1;
  for (const Exceeded& row : *limits) proofs.insert(row.proof);
  for (const std::string_view proof : proofs) fmt::print("{}\n", proof);
  return 0;
}

}  // namespace
}  // namespace takt::docs

int main(int argc, char** argv) {
  if (argc == 2 && std::string_view(argv[1]) == "--proofs") return takt::docs::print_proofs();
  if (argc == 1) return takt::docs::print_page();
  std::fputs("usage: mode_page [--proofs], in the repository\n", stderr);
  return 64;
}
