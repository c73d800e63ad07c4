// SPDX-License-Identifier: Apache-2.0
// Prints docs/hazards.md: the table of tests/hazards, the reaction table, and reaction times as they are measured
// now, in virtual time. `hazard_page --proofs`: the tests that the table names, one a line, and nothing measured.
// `hazard_page --mutants`: the faults that it names beside them (tests/mutants), each with the proofs of its row, one
// of which notices it: "fault\tproof", or "fault\tproof\tproof". Exit codes: 0 fine; 1 a cause was not met, or not
// within its bound; 64 command line.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <set>
#include <string_view>

#include "tests/docs/proof_name.hpp"
#include "tests/exploration/reaction_times.hpp"
#include "tests/exploration/world.hpp"
#include "tests/hazards/hazard_table.hpp"

namespace takt::hazards {
namespace {

using namespace exploration;
using pipeline::Reaction;
using pipeline::Stop;
using ReactionTimes = std::vector<ReactionTime>;

std::string_view category(Stop stop) {
  switch (stop) {
    case Stop::none:
      return "-";
    case Stop::category_0:
      return "0";
    case Stop::category_1:
      return "1";
    case Stop::category_2_damping:
      return "2d";
    case Stop::category_2:
      return "2";
  }
  return "";
}

std::string id(Unsafe unsafe) {
  const UnsafeRow& row = kUnsafe.at(static_cast<std::size_t>(unsafe));
  const auto first = std::ranges::find(kUnsafe, row.action, &UnsafeRow::action);
  return fmt::format("{}{}", kActions.at(static_cast<std::size_t>(row.action)).letter, &row - &*first + 1);
}

// "H1 H3": the members' numbers behind a letter.
template <class Enum>
std::string ids(SetOf<Enum> set, char letter, std::size_t count) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i)
    if (set.has(static_cast<Enum>(i))) text += fmt::format("{}{}{}", text.empty() ? "" : " ", letter, i + 1);
  return text;
}

std::string ids(SetOf<Hazard> set) {
  return ids(set, 'H', kHazards.size());
}

std::string ids(SetOf<Unsafe> set) {
  std::string text;
  for (const UnsafeRow& row : kUnsafe)
    if (set.has(row.id)) text += (text.empty() ? "" : " ") + id(row.id);
  return text;
}

// The whole robot's stop, or scope by scope: the joints, what hangs on them, the rest of the robot.
std::string stop_text(const Reaction& reaction) {
  const pipeline::Scope& stops = reaction.stops;
  if (stops.robot == Stop::none) return "no stop";
  if (stops.joints == Stop::none) return fmt::format("stop {}", category(stops.robot));
  return fmt::format("stop {}/{}/{}", category(stops.joints), category(stops.hanging), category(stops.robot));
}

void print_head() {
  fmt::print(R"(# Hazards

What can go wrong with a robot under Takt, how fast Takt reacts, which test proves it, and what stays to other devices.
The terms are those of STPA (Leveson and Thomas, STPA Handbook, 2018) and of IEC 60204-1 (stop categories).

**This page claims conformance to no standard.**
Takt is not a safety-rated control system, and none of its stops is an emergency stop.
Its single channel fails with the general-purpose computer that it runs on.
A robot's assessment has to name the devices of the last section.

Made by `build/release/bin/hazard_page >docs/hazards.md`.
`ctest -R hazards` runs every proof and measures every time again; one without a program's name is of `pipeline_test`.
`./dev mutants` plants a fault for each row, which one of its proofs has to notice ([mutants](../tests/mutants/README.md)).

```
 operator ── arm, stop, disarm ──► executive ── frames ──► drives ──► joints
 policy ──── targets, gains ─────►    ▲                      │
                                      └─ feedback, bus state ┘
```
)");
}

void print_losses_and_hazards() {
  fmt::print("\n## Losses\n\n| | loss |\n|---|---|\n");
  for (std::size_t i = 0; i < kLosses.size(); ++i) fmt::print("| L{} | {} |\n", i + 1, kLosses.at(i));
  fmt::print("\n## Hazards and constraints\n\n| | hazard | losses | constraint |\n|---|---|---|---|\n");
  for (std::size_t i = 0; i < kHazards.size(); ++i) {
    const HazardRow& row = kHazards.at(i);
    fmt::print("| H{} | {} | {} | {} |\n", i + 1, row.text, ids(row.losses, 'L', kLosses.size()), row.constraint);
  }
}

void print_unsafe_actions() {
  fmt::print(
      "\n## Unsafe control actions\n\nWrong time: too early, too late, out of order.\n"
      "Wrong length: ended too soon, lasts too long.\n");
  for (const ActionRow& action : kActions) {
    fmt::print(
        "\n### {}\n\nFrom {}.\n\n| | when | unsafe because | hazards | what the executive does | proof |\n"
        "|---|---|---|---|---|---|\n",
        action.name, action.from);
    for (const UnsafeRow& row : kUnsafe)
      if (row.action == action.action)
        fmt::print("| {} | {} | {} | {} | {} | `{}` |\n", id(row.id), kGuides.at(static_cast<std::size_t>(row.guide)),
                   row.text, ids(row.hazards), row.constraint, docs::short_name(row.proof));
  }
}

void print_times(const ReactionTimes& times) {
  fmt::print(R"(
## Reaction times

In milliseconds of virtual time, from the deviation to the last frame of the tick that reacts: the executive's own loop
at 1 kHz, drivers and guard, with simulated drives of `config/dual_arm12.yaml`.
Worst: on every joint or bus that can be struck, at five instants of a period.
Bound: the reaction table's, one period, one tick, and what the world takes to show it (an ODrive reports every 10 ms,
the policy answers after 12 ms).
Coming to rest takes further time; so does a real computer's lateness ([performance.md](performance.md)).

| cause | counted from | worst | bound |
|---|---|---|---|
)");
  for (const ReactionTime& time : times)
    fmt::print("| `{}` | {} | {:.1f} | {} |\n", name(time.cause), time.from, time.worst.milliseconds(),
               time.bound ? fmt::format("{:.1f}", time.bound->milliseconds()) : "chance");
}

void print_cause(const Row& row) {
  fmt::print("\n### `{}`\n\n", name(row.cause));
  fmt::print("{}; {}; {}; {}\n\n", ids(row.hazards), ids(row.unsafe), stop_text(pipeline::reaction(row.cause)),
             ids(row.devices, 'X', kDevices.size()));
  fmt::print("- {}\n- found: {}\n- risk: {}\n", row.scenario, row.found, row.residual);
  fmt::print("- `{}`,\n  `{}`\n", docs::short_name(row.proofs[0]), docs::short_name(row.proofs[1]));
}

void print_devices() {
  fmt::print("\n## Devices outside of this computer\n\n| | device |\n|---|---|\n");
  for (std::size_t i = 0; i < kDevices.size(); ++i) fmt::print("| X{} | {} |\n", i + 1, kDevices.at(i));
}

int print_page() {
  const auto times = measure_reaction_times(small_robot());
  if (!times) {
    fmt::print(stderr, "{}\n", times.error());
    return 1;
  }
  print_head();
  print_losses_and_hazards();
  print_unsafe_actions();
  print_times(*times);
  fmt::print(R"(
## Causes

Each entry has its hazards, the unsafe control actions that it answers, its stop, and the devices that have to cover it;
how it comes about, how it is found, which risk stays, and its proofs.
A share, count or time in "found" is a limit that is exceeded.
A stop's categories: 0: power off at once; 1: to rest, then power off; 2: to rest, power stays; 2d: 2 by damping only.
Three categories are those of the joints that the cause is about, what hangs on them, and the rest.
Modes, bounds and what clears a cause: [modes.md](modes.md#which-cause-leads-where).
)");
  for (const Row& row : kRows) print_cause(row);
  print_devices();
  return 0;
}

int print_proofs() {
  std::set<Proof> proofs;
  for (const UnsafeRow& row : kUnsafe) proofs.insert(row.proof);
  for (const Row& row : kRows) proofs.insert(row.proofs.begin(), row.proofs.end());
  for (const Proof proof : proofs) fmt::print("{}\n", proof);
  return 0;
}

int print_mutants() {
  for (const UnsafeRow& row : kUnsafe)
    if (!row.mutant.empty()) fmt::print("{}\t{}\n", row.mutant, row.proof);
  for (const Row& row : kRows)
    if (!row.mutant.empty()) fmt::print("{}\t{}\t{}\n", row.mutant, row.proofs[0], row.proofs[1]);
  return 0;
}

}  // namespace
}  // namespace takt::hazards

int main(int argc, char** argv) {
  if (argc == 2 && std::string_view(argv[1]) == "--proofs") return takt::hazards::print_proofs();
  if (argc == 2 && std::string_view(argv[1]) == "--mutants") return takt::hazards::print_mutants();
  if (argc == 1) return takt::hazards::print_page();
  std::fputs("usage: hazard_page [--proofs | --mutants], in the repository\n", stderr);
  return 64;
}
