// SPDX-License-Identifier: Apache-2.0
#include "lab/trace/command_chain.hpp"

#include <algorithm>

namespace takt::lab {
namespace {

std::uint64_t config_of(const Timeline& timeline, std::int64_t pid) {
  const auto process = timeline.processes.find(pid);
  return process == timeline.processes.end() ? 0 : process->second.config_hash;
}

// A host that never said its configuration may belong to any executive.
bool may_serve(const Timeline& timeline, std::int64_t host, std::int64_t executive) {
  const std::uint64_t a = config_of(timeline, host);
  const std::uint64_t b = config_of(timeline, executive);
  return a == 0 || b == 0 || a == b;
}

// Two robots with one configuration count alike: the answer must lie between its observation and its use.
bool fits(const Answer& answer, const CommandChain& chain, MonoTime latest) {
  const auto after = [](MonoTime instant, MonoTime earliest) { return !instant.is_set() || instant >= earliest; };
  const auto before = [](MonoTime instant, MonoTime limit) { return !instant.is_set() || instant <= limit; };
  return after(answer.infer_end_at, chain.observed) && before(answer.publish_begin_at, latest) &&
         before(answer.infer_end_at, latest);
}

const Answer* answer_to(const Timeline& timeline, const CommandChain& chain, std::int64_t executive) {
  const auto found = timeline.answers.find({chain.observation_id, chain.sequence});
  if (found == timeline.answers.end()) return nullptr;
  for (const Answer& answer : found->second) {
    if (may_serve(timeline, answer.pid, executive) && fits(answer, chain, chain.actuated)) return &answer;
  }
  return nullptr;
}

void observe(const TracedExecutive& executive, CommandChain& chain) {
  const auto publication = executive.publications.find(chain.observation_id);
  if (publication == executive.publications.end()) return;
  chain.sensed = publication->second.oldest_sensed_at;
  chain.observed = publication->second.published_at;
}

void answer(const Answer& answer, CommandChain& chain) {
  chain.host_pid = answer.pid;
  chain.inferred_from = answer.inferred_from;
  chain.inferred_to = answer.inferred_to;
  chain.published = answer.publish_end_at;
  if (answer.outside_sensed_at.is_set() && chain.sensed.is_set())
    chain.sensed = std::min(chain.sensed, answer.outside_sensed_at);
}

void count_gaps(const CommandChain& chain, Chains& chains) {
  chains.without_observation += chain.observed.is_set() ? 0U : 1U;
  chains.without_inference += chain.inferred_from.is_set() && chain.inferred_to.is_set() ? 0U : 1U;
  chains.without_publish += chain.published.is_set() ? 0U : 1U;
  chains.without_tick += chain.consumed.is_set() ? 0U : 1U;
}

}  // namespace

std::optional<Duration> stage_of(const CommandChain& chain, Stage stage) {
  const auto between = [](MonoTime from, MonoTime to) -> std::optional<Duration> {
    if (!from.is_set() || !to.is_set()) return std::nullopt;
    return to - from;
  };
  switch (stage) {
    case Stage::sense:
      return between(chain.sensed, chain.observed);
    case Stage::queue:
      return between(chain.observed, chain.inferred_from);
    case Stage::infer:
      return between(chain.inferred_from, chain.inferred_to);
    case Stage::publish:
      return between(chain.inferred_to, chain.published);
    case Stage::consume:
      return between(chain.published, chain.consumed);
    case Stage::actuate:
      return between(chain.consumed, chain.actuated);
    case Stage::total:
      return between(chain.sensed, chain.actuated);
  }
  return std::nullopt;
}

Chains chains_of(const Timeline& timeline, std::int64_t executive_pid) {
  Chains chains;
  const auto found = timeline.executives.find(executive_pid);
  if (found == timeline.executives.end()) return chains;
  const TracedExecutive& executive = found->second;
  for (const Consumption& read : executive.consumptions) {
    if (read.arrival != static_cast<std::uint8_t>(Arrival::accepted)) {
      ++chains.refused;
      continue;
    }
    CommandChain chain{.sequence = read.sequence, .observation_id = read.observation_id, .tick = read.tick};
    chain.actuated = read.at;
    chain.told = read.age;
    const auto tick = std::ranges::lower_bound(executive.ticks, read.tick, {}, &TracedTick::tick);
    if (tick != executive.ticks.end() && tick->tick == read.tick) chain.consumed = tick->now;
    observe(executive, chain);
    if (const Answer* const from = answer_to(timeline, chain, executive_pid)) answer(*from, chain);
    count_gaps(chain, chains);
    chains.accepted.push_back(chain);
  }
  return chains;
}

}  // namespace takt::lab
