// SPDX-License-Identifier: Apache-2.0
// Goal: where a robot file names a key, only the policy that the key's owner signed is accepted, and every refusal says
// what to correct. Method: a policy with weights beside it, signed as docs/policies.md says; then each part of it, its
// signature and the key made otherwise.
#include "config/policy_signature.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "config/hash.hpp"
#include "config/load.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::config {
namespace {

using testing::HasSubstr;

class PolicySignatureTest : public testing::Test {
 protected:
  PolicySignatureTest() {
    write("policy.onnx", "network");
    write("policy.onnx.data", "weights");
    for (const char* const key : {"lab", "other"}) {
      shell(std::string("openssl genpkey -algorithm ed25519 -out ") + key + ".pem");
      shell(std::string("openssl pkey -pubout -in ") + key + ".pem -out " + key + ".pub");
    }
    policy_.file = folder_.path("policy.onnx");
    policy_.signed_by = folder_.path("lab.pub");
  }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_.path(name)) << text; }
  void shell(const std::string& command) const {
    ASSERT_EQ(std::system(("cd " + folder_.path() + " && " + command + " 2>>log").c_str()), 0) << command;
  }
  void sign(const std::string& key) const {
    shell("sha256sum policy.onnx policy.onnx.data | openssl dgst -sha256 -binary > digest");
    shell("openssl pkeyutl -sign -rawin -inkey " + key + ".pem -in digest -out policy.onnx.sig");
  }
  [[nodiscard]] std::string refusal() const {
    const auto hash = accepted_policy_sha256(policy_);
    return hash ? "" : hash.error();
  }
  const test::TemporaryDirectory folder_;
  Policy policy_;
};

TEST_F(PolicySignatureTest, TheOwnersSignatureIsAccepted) {
  sign("lab");
  EXPECT_EQ(refusal(), "");
  EXPECT_EQ(accepted_policy_sha256(policy_).value(), policy_sha256(policy_.file).value());
}

TEST_F(PolicySignatureTest, WithoutAKeyNoSignatureIsAskedFor) {
  policy_.signed_by = "none";
  EXPECT_EQ(accepted_policy_sha256(policy_).value(), policy_sha256(policy_.file).value());
}

// Threat: policy-unsigned
TEST_F(PolicySignatureTest, AnythingElseIsRefusedAndSaysWhatToCorrect) {
  EXPECT_THAT(refusal(), HasSubstr("policy.onnx: no signature: "));
  EXPECT_THAT(refusal(), HasSubstr("policy.onnx.sig: cannot be read: No such file or directory"));
  EXPECT_THAT(refusal(), HasSubstr("; sign it with the key of `policy.signed_by`"));
  sign("other");
  EXPECT_THAT(refusal(), HasSubstr("policy.onnx is not the file that the key of `policy.signed_by` signed"));
  sign("lab");
  write("policy.onnx.data", "weighty");
  EXPECT_THAT(refusal(), HasSubstr("is not the file that the key"));
  write("policy.onnx.data", "weights");
  write("policy.onnx", "netwerk");
  EXPECT_THAT(refusal(), HasSubstr("is not the file that the key"));
  write("policy.onnx", "networ");
  write("policy.onnx.data", "kweights");
  EXPECT_THAT(refusal(), HasSubstr("is not the file that the key")) << "the same bytes, one behind the other";
  write("policy.onnx", "network");
  write("policy.onnx.data", "weights");
  EXPECT_EQ(refusal(), "");
  write("policy.onnx.sig", "signed");
  EXPECT_THAT(refusal(), HasSubstr("policy.onnx.sig holds 6 bytes, and a signature of Ed25519 has 64"));
  sign("lab");
  for (const char* const key : {"/policy.onnx", "/lab.pem"}) {
    policy_.signed_by = folder_.path() + key;
    EXPECT_THAT(refusal(), HasSubstr("holds no public key of Ed25519 in PEM form; correct `policy.signed_by`"));
  }
  policy_.signed_by = folder_.path("gone.pub");
  EXPECT_THAT(refusal(), HasSubstr("gone.pub: cannot be read"));
  std::filesystem::remove(policy_.file);
  EXPECT_THAT(refusal(), HasSubstr("check `policy.file`"));
}

}  // namespace
}  // namespace takt::config
