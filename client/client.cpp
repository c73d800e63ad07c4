// takt/client.h over PolicySession: what crosses into C is checked here, and no exception leaves.
#include "client/takt/client.h"

#include <algorithm>
#include <cstdint>
#include <exception>
#include <expected>
#include <memory>
#include <string>
#include <utility>

#include "client/policy_session.hpp"

struct takt_policy {
  std::unique_ptr<takt::client::PolicySession> session;
  std::string bug;
};

namespace {

using takt::client::PolicySession;
using takt::client::PolicySpec;

constexpr std::uint32_t kMostTerms = 64;

std::string text_of(const char* text) {
  return text == nullptr ? std::string() : text;
}

// What cannot be meant; empty: nothing.
const char* fault_in(const takt_policy_spec* spec) {
  if (spec == nullptr || spec->size != sizeof *spec)
    return "takt_policy_spec has another size: set `size`, and compile with the header of this library";
  if (spec->reserved != 0) return "takt_policy_spec: reserved is not 0";
  if (spec->terms == nullptr || spec->term_count < 1 || spec->term_count > kMostTerms)
    return "takt_policy_spec: a policy observes 1 to 64 terms";
  if (spec->robot_file == nullptr || spec->step == nullptr) return "takt_policy_spec: robot_file and step must be said";
  for (std::uint32_t i = 0; i < spec->term_count; ++i) {
    const takt_term& term = spec->terms[i];
    if (term.kind > TAKT_TERM_STREAM) return "takt_term: this kind of term does not exist";
    if ((term.kind == TAKT_TERM_STREAM) != (term.stream != nullptr))
      return "takt_term: a stream has a name, and nothing else has";
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
  for (std::uint32_t i = 0; i < given.term_count; ++i)
    spec.terms.push_back({given.terms[i].kind, given.terms[i].values, text_of(given.terms[i].stream)});
  return spec;
}

void tell(const std::string& sentence, char* why, std::uint32_t why_bytes) {
  if (why == nullptr || why_bytes == 0) return;
  why[sentence.copy(why, why_bytes - 1)] = '\0';
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
  if (policy == nullptr) return TAKT_USAGE;
  *policy = nullptr;
  try {
    std::string sentence;
    const int result = open(spec, policy, sentence);
    tell(sentence, why, why_bytes);
    return result;
  } catch (const std::exception& error) {
    tell(std::string("libtakt-client: ") + error.what(), why, why_bytes);
    return TAKT_BUG;
  }
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

const takt_robot* takt_policy_robot(const takt_policy* policy) {
  return &policy->session->robot();
}

const takt_observation* takt_policy_observation(const takt_policy* policy) {
  return &policy->session->observation();
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
