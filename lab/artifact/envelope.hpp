// SPDX-License-Identifier: Apache-2.0
// A DSSE envelope (github.com/secure-systems-lab/dsse, version 1) around an in-toto Statement v1, signed by Ed25519.
//
// Keys are PEM files as OpenSSL writes them, of Ed25519 only. Errors are one sentence. Thread rule: any thread.
#pragma once

#include <expected>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace takt::lab {

inline constexpr const char* kStatementType = "https://in-toto.io/Statement/v1";

// The envelope's text. `statement`: JSON, its `_type` kStatementType.
std::expected<std::string, std::string> seal_envelope(const std::string& statement, std::string_view private_key_pem);

struct OpenedEnvelope {
  std::string key_id;  // SHA-256 of the key's DER form
  nlohmann::ordered_json statement;
};
// Refused where that key did not sign it. `file`: its name, for the sentence.
std::expected<OpenedEnvelope, std::string> open_envelope(const std::string& text, const std::string& file,
                                                         std::string_view public_key_pem);

// Empty: not there, or no text.
std::string text_at(const nlohmann::ordered_json& json, const char* key);

}  // namespace takt::lab
