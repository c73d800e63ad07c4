// SPDX-License-Identifier: Apache-2.0
// Goal: only the configured policy for this very robot is admitted, and a refusal names both values. Method: an
// admissible hello, then one deviation at a time.
#include "executive/runtime/admission.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace takt::runtime {
namespace {

using testing::HasSubstr;

const AdmissionRules kRules{0xAAAA, 0xBBBB, 0xCCCC, 6, 16, "reach.onnx", ""};

Hello admissible() {
  Hello hello;
  hello.config_hash = 0xAAAA;
  hello.policy_hash = 0xBBBB;
  hello.joint_names_hash = 0xCCCC;
  hello.joint_count = 6;
  hello.step_count = 16;
  return hello;
}

TEST(Admission, TheConfiguredPolicyIsAdmitted) {
  EXPECT_EQ(refusal_of_policy(admissible(), kRules), "");
}

TEST(Admission, AnUnclaimedConfigurationIsAccepted) {
  Hello hello = admissible();
  hello.config_hash = 0;
  EXPECT_EQ(refusal_of_policy(hello, kRules), "");
}

TEST(Admission, WithoutAConfiguredPolicyAnyPolicyAndStepCountWill) {
  AdmissionRules rules = kRules;
  rules.policy_hash = 0;
  rules.step_count = 0;
  Hello hello = admissible();
  hello.policy_hash = 0x1234;
  hello.step_count = 3;
  EXPECT_EQ(refusal_of_policy(hello, rules), "");
}

// Goal: a candidate may be any policy that says which it is and fits the robot; while one is in charge only that one
// may come back. Method: hellos of such, one deviation at a time.
TEST(Admission, ACandidateMayBeAnyPolicyOfThisRobotThatSaysWhichItIs) {
  Hello hello = admissible();
  hello.policy_hash = 0x1234;
  EXPECT_EQ(refusal_of_candidate(hello, kRules, 0), "");
  EXPECT_EQ(refusal_of_candidate(hello, kRules, 0x1234), "");
  EXPECT_THAT(refusal_of_candidate(hello, kRules, 0x5678), HasSubstr("candidate 0000000000005678 is in charge"));
  hello.step_count = 8;
  EXPECT_THAT(refusal_of_candidate(hello, kRules, 0), HasSubstr("8 steps"));
  hello = admissible();
  hello.policy_hash = 0;
  EXPECT_THAT(refusal_of_candidate(hello, kRules, 0), HasSubstr("which policy it is"));
  hello = admissible();
  AdmissionRules signed_only = kRules;
  signed_only.signed_by = "/etc/lab.pub";
  EXPECT_EQ(refusal_of_policy(hello, signed_only), "") << "its file was checked at the start";
  EXPECT_EQ(
      refusal_of_candidate(hello, signed_only, 0),
      "this robot takes policies signed by /etc/lab.pub only, and a candidate shows no signature: deploy it instead");
}

struct Deviation {
  const char* when;
  void (*make)(Hello&);
  const char* theirs;
  const char* ours;
};
const Deviation kDeviations[] = {
    {"another configuration", [](Hello& h) { h.config_hash = 0xDEAD; }, "000000000000dead", "000000000000aaaa"},
    {"another policy file", [](Hello& h) { h.policy_hash = 0xDEAD; }, "000000000000dead", "000000000000bbbb"},
    {"no policy hash at all", [](Hello& h) { h.policy_hash = 0; }, "0000000000000000", "reach.onnx"},
    {"other joint names", [](Hello& h) { h.joint_names_hash = 0xDEAD; }, "000000000000dead", "000000000000cccc"},
    {"another number of joints", [](Hello& h) { h.joint_count = 7; }, "7 joints", "has 6"},
    {"another chunk length", [](Hello& h) { h.step_count = 8; }, "8 steps", "says 16"},
};

TEST(Admission, EveryDeviationIsRefusedNamingBothValues) {
  for (const Deviation& deviation : kDeviations) {
    Hello hello = admissible();
    deviation.make(hello);
    const std::string sentence = refusal_of_policy(hello, kRules);
    EXPECT_THAT(sentence, HasSubstr(deviation.theirs)) << deviation.when;
    EXPECT_THAT(sentence, HasSubstr(deviation.ours)) << deviation.when;
    EXPECT_EQ(sentence.find('\n'), std::string::npos) << deviation.when;
  }
}

TEST(Admission, AMonitorNeedsTheSameConfigurationOnly) {
  Hello hello;
  EXPECT_EQ(refusal_of_monitor(hello, kRules), "");
  hello.config_hash = 0xDEAD;
  EXPECT_THAT(refusal_of_monitor(hello, kRules), HasSubstr("000000000000dead"));
}

}  // namespace
}  // namespace takt::runtime
