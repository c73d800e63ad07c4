// SPDX-License-Identifier: Apache-2.0
// Prints docs/modes.md: what the tick gives each joint in every mode, as it is measured now (mode_situations.hpp), the
// reaction table, what every request does, and rules with their tests (mode_rules.hpp). `mode_page --proofs`: those
// tests, one a line. Exit codes: 0 fine; 1 a situation was not reached, or has no words; 64 command line.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <set>
#include <span>
#include <string>

#include "executive/pipeline/mode_machine.hpp"
#include "tests/docs/mode_rules.hpp"
#include "tests/docs/mode_situations.hpp"
#include "tests/docs/proof_name.hpp"

namespace takt::docs {
namespace {

using pipeline::Reaction;
using pipeline::Stop;

constexpr std::array kRules{
    std::span<const Rule>(kUsableRules), std::span<const Rule>(kSilenceRules), std::span<const Rule>(kGivenRules),
    std::span<const Rule>(kStopRules),   std::span<const Rule>(kResetRules),   std::span<const Rule>(kArmRules),
    std::span<const Rule>(kLimitRules),
};

void print_head() {
  fmt::print(R"(# Modes, stops and resets

What each joint is given in every mode, which cause leads where, and what every request asks, refuses and does.

Made by `build/release/bin/mode_page >docs/modes.md`: all tables but those of rules and causes are measured.
`ctest -R docs_modes` measures again, and runs every test that is named here; one without a program's name is of
`pipeline_test`.

```
             arm              enabled            late, violated
  standby ─────────► arming ──────────► tracking ◄────────────► degraded
     ▲                 │                   │      restored          │
     │                 └─────────┬─────────┴────────────────────────┘
     │  reset            stop or │ fault
     └───────────── damped_stop or fault_latched
```

Only an operator leads from `damped_stop` or `fault_latched` to standby: by a reset, or by taking the power.
An executive that starts is in standby, and [knows of no stop](troubleshooting.md#keep-it-stopped).
)");
}

void print_rules(std::span<const Rule> rules) {
  fmt::print("\n| rule | test |\n|---|---|\n");
  for (const Rule& rule : rules) fmt::print("| {} | `{}` |\n", rule.text, short_name(rule.proof));
}

void print_situations(const std::vector<Situation>& situations) {
  fmt::print(R"(
## What each joint is given

A joint's torque is `kp · (reference − position) + kd · (velocity setpoint − velocity) + gravity + torque`.
Gravity is the model's torque; a robot without a `model` has none.
Gains: "joint's" are `gains.kp` and `gains.kd`; "damping" is `gains.damping` with kp 0; "command's" are those of the
command that is played.
"Brakes": along `limits.acceleration`, then it stays.
Drives in csp and csv damp [by their own loop](design.md#how-a-stop-stops).

| mode | when, or which joint | reference | gains | torque |
|---|---|---|---|---|
)");
  for (auto row = situations.begin(); row != situations.end();) {
    const auto is_other = [&](const Situation& one) { return one.mode != row->mode || one.given != row->given; };
    const auto end = std::ranges::find_if(row, situations.end(), is_other);
    fmt::print("| {} | {}", row->mode, row->when);
    for (auto same = row + 1; same != end; ++same) fmt::print("; {}", same->when);
    fmt::print(" | {} | {} | {} |\n", row->given.reference, row->given.gains, row->given.torque);
    row = end;
  }
  print_rules(kGivenRules);
}

std::string_view meaning(std::string_view instant) {
  if (instant == "aging") return "the command is `aging`: usable still";
  if (instant == "stale") return "the command is `stale`: each joint brakes; the mode is still `tracking`";
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

// Every mode that a cause leads on from, of the modes in the order of their gravity: "arming, tracking".
std::string origins(const Reaction& row, Mode to) {
  std::string from;
  for (std::size_t mode = 0; mode < kModeCount; ++mode)
    if (static_cast<Mode>(mode) != to && row.to.at(mode) == to)
      from += fmt::format("{}{}", from.empty() ? "" : ", ", name(static_cast<Mode>(mode)));
  return from;
}

// From where most causes lead on; "": there is no such rule.
std::string usual_origins(Mode to) {
  if (to == Mode::damped_stop) return "arming, tracking, degraded";
  if (to == Mode::fault_latched) return "arming, tracking, degraded, damped_stop";
  return to == Mode::degraded ? "tracking" : "";
}

// What becomes of the power, where it is not what the mode says.
std::string_view power(const Reaction& row) {
  if (row.stops.joints != Stop::none) return "";
  switch (row.stops.robot) {
    case Stop::none:
    case Stop::category_1:  // its bound says it
    case Stop::category_2:
      return "";
    case Stop::category_0:
      return ", power off";
    case Stop::category_2_damping:
      return ", all damping";
  }
  return "";
}

std::string leads_to(const Reaction& row) {
  std::string text;
  for (std::size_t mode = 0; mode < kModeCount; ++mode) {
    const auto to = static_cast<Mode>(mode);
    const std::string from = origins(row, to);
    if (from.empty()) continue;
    text += text.empty() ? "" : "; ";
    if (from != usual_origins(to)) text += from + " → ";
    text += name(to);
  }
  return text.append(power(row));
}

std::string without_end(std::string_view text, std::string_view end) {
  if (text.ends_with(end)) text.remove_suffix(end.size());
  return std::string(text);
}

// Of faults that a share of a window is, the same words.
std::string clears_when(const Reaction& row) {
  if (row.bound.starts_with("bus_faults.window")) return "its share of the window falls to the limit";
  return without_end(without_end(row.clears_when, "; then takt reset"), "; mode: contract_restored");
}

// Those that must be gone before a reset is granted.
std::string lasting_faults() {
  std::string text;
  for (const Reaction& row : pipeline::kReactions)
    if ((pipeline::kLastingFaults & pipeline::bit(row.cause)) != 0)
      text += fmt::format("{}`{}`", text.empty() ? "" : ", ", name(row.cause));
  return text;
}

void print_causes() {
  fmt::print(R"(
## Which cause leads where

The gravest cause is first: of all that hold in a tick, the first one that leads on from the present mode decides.
What each cause is, and what it leaves to other devices: [hazards.md](hazards.md).

- Where no origin is named: to degraded from tracking; to damped_stop from arming, tracking and degraded; to
  fault_latched also from damped_stop.
- A damped stop leaves the power on; a fault takes it from the joints that it is about.
- Within: one tick, or one tick after what is named.
- Clears when: then it blocks arming no longer.
  Out of damped_stop and fault_latched leads `takt reset` alone, out of degraded `contract_restored`.
- A reset asks for rest, and for the end of these causes alone:
  {}.
- In standby and in a stop `overtemperature` holds from 5 degrees below its limit on.
- `temperature_high` is only told, unless `degraded.by_temperature` is true; `following_error`, unless
  `feedback.following` is `degrade`.

| cause | leads to | within | clears when |
|---|---|---|---|
)",
             lasting_faults());
  std::vector<Reaction> rows(pipeline::kReactions.begin() + 1, pipeline::kReactions.end());
  std::ranges::sort(rows, std::ranges::greater{}, &Reaction::severity);
  const auto cells = [](const Reaction& row) {
    return fmt::format("{} | {} | {}", leads_to(row), without_end(row.bound, ", one tick"), clears_when(row));
  };
  for (auto row = rows.begin(); row != rows.end();) {
    const auto is_other = [&](const Reaction& one) { return cells(one) != cells(*row); };
    const auto end = std::ranges::find_if(row, rows.end(), is_other);
    fmt::print("| `{}`", name(row->cause));
    for (auto same = row + 1; same != end; ++same) fmt::print(", `{}`", name(same->cause));
    fmt::print(" | {} |\n", cells(*row));
    row = end;
  }
}

void print_requests(const std::vector<RequestRow>& rows) {
  fmt::print(R"(
## What a request does

The mode one tick after the request, by the mode in which it comes. "not there": the mode is left before.

| request |)");
  for (std::size_t mode = 0; mode < kModeCount; ++mode) fmt::print(" {} |", name(static_cast<Mode>(mode)));
  fmt::print("\n|---|---|---|---|---|---|---|\n");
  for (auto row = rows.begin(); row != rows.end();) {
    const auto end =
        std::ranges::find_if(row, rows.end(), [&](const auto& other) { return other.leads_to != row->leads_to; });
    fmt::print("| {}", row->request);
    for (auto same = row + 1; same != end; ++same) fmt::print("; {}", same->request);
    fmt::print(" |");
    for (const std::string& to : row->leads_to) fmt::print(" {} |", to);
    fmt::print("\n");
    row = end;
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

0: done; 1: refused (`takt arm`, `takt reset`); 69: no executive answers, or not this user.
A stop that no tick read within 0.1 s ends with 0 too; it prints `the control thread did not answer in time`.
All codes: [exit-codes.md](exit-codes.md).
)");
}

void print_limits(const std::vector<Exceeded>& rows) {
  fmt::print(R"(
## What a limit leads to

| key | exceeded by | leads to | test |
|---|---|---|---|
)");
  for (const Exceeded& row : rows)
    fmt::print("| `{}` | {} | `{}`, {}{} | `{}` |\n", row.key, row.how, row.cause, row.mode,
               row.keeps_power ? "" : ", a drive loses power", short_name(row.proof));
  print_rules(kLimitRules);
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
