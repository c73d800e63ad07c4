// SPDX-License-Identifier: Apache-2.0
// Who stands by an artifact or a run folder: an Ed25519 signature over its seal, in the file seal.dsse.json beside it.
//
// The file is a DSSE envelope (github.com/secure-systems-lab/dsse, version 1) around an in-toto Statement v1 with the
// predicate test-result v0.1, so that the tools of both read it. Subjects: seal.json, which names every other file, and
// each of an artifact's post-mortems that was there. A signature proves who signed, to whom has the public key from the
// signer: any user can sign an edited artifact with a key of their own.
//
// seal.tsr beside it says since when (time_stamp.hpp).
//
// Keys are PEM files as OpenSSL writes them, of Ed25519 only. Errors are one sentence. Thread rule: any thread.
#pragma once

#include <expected>
#include <string>
#include <string_view>

#include "lab/artifact/artifact.hpp"
#include "lab/artifact/time_stamp.hpp"
#include "monitor/record/recorded_run.hpp"

namespace takt::lab {

inline constexpr const char* kSignatureFile = "seal.dsse.json";

// What the signer's audit came to, in the predicate's words.
enum class SignedResult : std::uint8_t {
  passed,  // nothing was missing
  warned,  // something was
};

// The envelope's text. Precondition: a finished artifact, as open_finished_artifact takes it; a run folder whose seal
// is whole.
std::expected<std::string, std::string> sign(const Artifact& artifact, SignedResult result,
                                             std::string_view private_key_pem);
std::expected<std::string, std::string> sign(const monitor::RecordedRun& run, SignedResult result,
                                             std::string_view private_key_pem);

// The id of the key, where the folder's envelope is signed by it and every subject is the file that was signed; else
// why not. A post-mortem that was written later is no subject, and no error.
std::expected<std::string, std::string> check_signature(const std::string& folder, std::string_view public_key_pem);

// When an authority of those certificates stamped the folder's envelope (kTimeStampFile).
std::expected<TimeStamp, std::string> check_time(const std::string& folder, std::string_view certificates_pem);

}  // namespace takt::lab
