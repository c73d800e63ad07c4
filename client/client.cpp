// SPDX-License-Identifier: Apache-2.0
// takt/client.h over PolicySession and SensorSession: what crosses into C is checked here, and no exception leaves.
#include "client/takt/client.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <expected>
#include <memory>
#include <string>
#include <utility>

#include "client/policy_session.hpp"
#include "client/sensor_session.hpp"

struct takt_sensor {
  std::unique_ptr<takt::client::SensorSession> session;
};

struct takt_policy {
  std::unique_ptr<takt::client::PolicySession> session;
  std::string bug;
};

namespace {

using takt::client::PolicySession;
using takt::client::PolicySpec;
using takt::client::SensorSession;
using takt::client::SensorSpec;

constexpr std::uint32_t kMostTerms = 64;

std::string text_of(const char* text) {
  return text == nullptr ? std::string() : text;
}

// Of a program that was compiled before there were candidates, or before joins, units and ages were compared: terms
// were shorter then.
constexpr std::size_t kSizeWithoutCandidate = offsetof(takt_policy_spec, candidate_file);
constexpr std::size_t kSizeWithoutJoin = offsetof(takt_policy_spec, join);
constexpr std::size_t kTermWithoutUnit = offsetof(takt_term, unit);

takt_term term_of(const takt_policy_spec& spec, std::uint32_t index) {
  if (spec.size == sizeof spec) return spec.terms[index];
  takt_term term{};
  std::memcpy(&term, reinterpret_cast<const std::byte*>(spec.terms) + index * kTermWithoutUnit, kTermWithoutUnit);
  return term;
}

// What cannot be meant; empty: nothing.
const char* fault_in(const takt_term& term) {
  if (term.kind > TAKT_TERM_DQ_OF_DRIVE) return "takt_term: this kind of term does not exist";
  const bool of_sensor = term.kind == TAKT_TERM_STREAM || term.kind == TAKT_TERM_IMAGE || term.kind == TAKT_TERM_QUEUE;
  if (of_sensor != (term.stream != nullptr))
    return "takt_term: a stream, an image or a queue has a name, and nothing else has";
  if (!of_sensor && (term.unit != nullptr || term.max_age != nullptr))
    return "takt_term: unit and max_age are those of a stream, an image or a queue";
  return "";
}

const char* fault_in(const takt_policy_spec* spec) {
  if (spec == nullptr ||
      (spec->size != sizeof *spec && spec->size != kSizeWithoutJoin && spec->size != kSizeWithoutCandidate))
    return "takt_policy_spec has another size: set `size`, and compile with the header of this library";
  if (spec->reserved != 0) return "takt_policy_spec: reserved is not 0";
  if (spec->terms == nullptr || spec->term_count < 1 || spec->term_count > kMostTerms)
    return "takt_policy_spec: a policy observes 1 to 64 terms";
  if (spec->robot_file == nullptr || spec->step == nullptr) return "takt_policy_spec: robot_file and step must be said";
  for (std::uint32_t i = 0; i < spec->term_count; ++i) {
    if (const char* const fault = fault_in(term_of(*spec, i)); *fault != '\0') return fault;
  }
  return "";
}

PolicySpec copy_of(const takt_policy_spec& given) {
  PolicySpec spec;
  spec.robot_file = given.robot_file;
  spec.runtime_directory = text_of(given.runtime_directory);
  spec.program = text_of(given.program);
  spec.step = given.step;
  spec.steps = given.steps;
  if (given.size != kSizeWithoutCandidate) spec.candidate_file = text_of(given.candidate_file);
  if (given.size == sizeof given) spec.join = text_of(given.join);
  for (std::uint32_t i = 0; i < given.term_count; ++i) {
    const takt_term term = term_of(given, i);
    spec.terms.push_back({term.kind, term.values, text_of(term.stream), text_of(term.unit), text_of(term.max_age)});
  }
  return spec;
}

void tell(const std::string& sentence, char* why, std::uint32_t why_bytes) {
  if (why == nullptr || why_bytes == 0) return;
  why[sentence.copy(why, why_bytes - 1)] = '\0';
}

const char* fault_in(const takt_sensor_spec* spec) {
  if (spec == nullptr || spec->size != sizeof *spec)
    return "takt_sensor_spec has another size: set `size`, and compile with the header of this library";
  if (spec->robot_file == nullptr || spec->name == nullptr) return "takt_sensor_spec: robot_file and name must be said";
  if (spec->type != TAKT_FLOAT32 && spec->type != TAKT_UINT8)
    return "takt_sensor_spec: this type of values does not exist";
  return "";
}

SensorSpec copy_of(const takt_sensor_spec& given) {
  return {.robot_file = given.robot_file,
          .runtime_directory = text_of(given.runtime_directory),
          .name = given.name,
          .unit = text_of(given.unit),
          .policy_user = text_of(given.policy_user),
          .is_image = given.type == TAKT_UINT8,
          .values = given.values,
          .image = {given.height, given.width, given.channels}};
}

int open(const takt_sensor_spec* given, takt_sensor** sensor, std::string& why) {
  why = fault_in(given);
  if (!why.empty()) return TAKT_USAGE;
  auto session = SensorSession::open(copy_of(*given));
  if (!session) {
    why = session.error().sentence;
    return session.error().code;
  }
  *sensor = new takt_sensor{std::move(*session)};
  return TAKT_OK;
}

int open(const takt_policy_spec* given, takt_policy** policy, std::string& why) {
  why = fault_in(given);
  if (!why.empty()) return TAKT_USAGE;
  auto session = PolicySession::open(copy_of(*given));
  if (!session) {
    why = session.error().sentence;
    return session.error().code;
  }
  *policy = new takt_policy{std::move(*session), {}};
  return TAKT_OK;
}

// Opens either kind, with what it throws turned into TAKT_BUG.
template <class Spec, class Made>
int open_guarded(const Spec* spec, Made** made, char* why, std::uint32_t why_bytes) noexcept {
  if (made == nullptr) return TAKT_USAGE;
  *made = nullptr;
  try {
    std::string sentence;
    const int result = open(spec, made, sentence);
    tell(sentence, why, why_bytes);
    return result;
  } catch (const std::exception& error) {
    tell(std::string("libtakt-client: ") + error.what(), why, why_bytes);
    return TAKT_BUG;
  }
}

// The call, with what it throws turned into TAKT_BUG.
template <class Call>
int guarded(takt_policy* policy, Call call) noexcept {
  if (policy == nullptr) return TAKT_USAGE;
  try {
    return call(*policy->session);
  } catch (const std::exception& error) {
    policy->bug = std::string("libtakt-client: ") + error.what();
    return TAKT_BUG;
  }
}

takt::Duration span_of(std::int64_t timeout_ns) {
  return {std::clamp<std::int64_t>(timeout_ns, 0, takt::seconds(3600).ns)};
}

}  // namespace

uint32_t takt_client_abi(void) {
  return TAKT_CLIENT_ABI;
}

int takt_policy_open(const takt_policy_spec* spec, takt_policy** policy, char* why, uint32_t why_bytes) {
  return open_guarded(spec, policy, why, why_bytes);
}

int takt_policy_attach(takt_policy* policy, int64_t timeout_ns) {
  return guarded(policy, [&](PolicySession& session) { return session.attach(span_of(timeout_ns)); });
}

int takt_policy_next(takt_policy* policy, int64_t timeout_ns) {
  return guarded(policy, [&](PolicySession& session) { return session.next(span_of(timeout_ns)); });
}

int takt_policy_infer_begin(takt_policy* policy) {
  return guarded(policy, [](PolicySession& session) { return session.infer_begin(); });
}

int takt_policy_infer_end(takt_policy* policy) {
  return guarded(policy, [](PolicySession& session) { return session.infer_end(); });
}

int takt_policy_publish(takt_policy* policy, const takt_chunk* chunk) {
  if (chunk == nullptr) return TAKT_USAGE;
  return guarded(policy, [&](PolicySession& session) { return session.publish(*chunk); });
}

int takt_policy_state_problem(takt_policy* policy, const char* problem) {
  return guarded(policy,
                 [&](PolicySession& session) { return session.state_problem(problem == nullptr ? "" : problem); });
}

int takt_policy_state_source(takt_policy* policy, const char* source) {
  return guarded(policy, [&](PolicySession& session) { return session.state_source(source == nullptr ? "" : source); });
}

const takt_robot* takt_policy_robot(const takt_policy* policy) {
  return &policy->session->robot();
}

const takt_observation* takt_policy_observation(const takt_policy* policy) {
  return &policy->session->observation();
}

const takt_alternatives* takt_policy_alternatives(const takt_policy* policy) {
  return &policy->session->alternatives();
}

const takt_stream* takt_policy_stream(const takt_policy* policy, const char* name) {
  return name == nullptr ? nullptr : policy->session->stream(name);
}

const char* takt_policy_sentence(const takt_policy* policy) {
  return policy->bug.empty() ? policy->session->sentence().c_str() : policy->bug.c_str();
}

void takt_policy_detach(takt_policy* policy) {
  policy->session->detach();
}

void takt_policy_close(takt_policy* policy) {
  delete policy;
}

int takt_sensor_open(const takt_sensor_spec* spec, takt_sensor** sensor, char* why, uint32_t why_bytes) {
  return open_guarded(spec, sensor, why, why_bytes);
}

void* takt_sensor_values(takt_sensor* sensor) {
  return sensor->session->values();
}

int takt_sensor_publish(takt_sensor* sensor, int64_t sensed_ns) {
  return sensor == nullptr ? TAKT_USAGE : sensor->session->publish({sensed_ns});
}

const takt_stream* takt_sensor_stream(const takt_sensor* sensor) {
  return &sensor->session->stream();
}

const char* takt_sensor_sentence(const takt_sensor* sensor) {
  return sensor->session->sentence();
}

void takt_sensor_close(takt_sensor* sensor) {
  delete sensor;
}
