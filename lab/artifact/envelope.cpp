// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/envelope.hpp"

#include <fmt/format.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <algorithm>
#include <memory>
#include <optional>

#include "config/load.hpp"
#include "config/sha256.hpp"
#include "monitor/record/strict_json.hpp"

namespace takt::lab {
namespace {

using Json = nlohmann::ordered_json;
using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;
using Digest = std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)>;

constexpr const char* kPayloadType = "application/vnd.in-toto+json";
constexpr std::size_t kSignatureBytes = 64;
constexpr std::size_t kLargestEnvelope = 64U << 20U;

const unsigned char* bytes_of(std::string_view text) {
  return reinterpret_cast<const unsigned char*>(text.data());
}

template <class Read>
std::expected<Key, std::string> key_of(std::string_view pem, const char* kind, Read read) {
  const std::unique_ptr<BIO, decltype(&BIO_free)> bio(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())),
                                                      &BIO_free);
  // A key behind a password is refused rather than asked for.
  const auto no_password = [](char*, int, int, void*) { return -1; };
  Key key(read(bio.get(), nullptr, no_password, nullptr), &EVP_PKEY_free);
  if (!key || EVP_PKEY_get_id(key.get()) != EVP_PKEY_ED25519)
    return std::unexpected(fmt::format("it holds no {} key of Ed25519 in PEM form, without a password", kind));
  return key;
}

// SHA-256 of the public key's DER form, as `openssl pkey -pubin -outform DER | sha256sum` prints it.
std::string id_of(EVP_PKEY* key) {
  unsigned char* der = nullptr;
  const int size = i2d_PUBKEY(key, &der);
  std::string id =
      size > 0 ? config::sha256_hex({reinterpret_cast<const char*>(der), static_cast<std::size_t>(size)}) : "";
  OPENSSL_free(der);
  return id;
}

std::string base64_of(std::string_view bytes) {
  std::string text((bytes.size() + 2) / 3 * 4 + 1, '\0');
  const int size =
      EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()), bytes_of(bytes), static_cast<int>(bytes.size()));
  text.resize(static_cast<std::size_t>(size));
  return text;
}

// Nothing that is not the one encoding of its bytes.
std::optional<std::string> bytes_of_base64(std::string_view text) {
  if (text.empty() || text.size() % 4 != 0) return std::nullopt;
  std::string bytes(text.size() / 4 * 3, '\0');
  const int size =
      EVP_DecodeBlock(reinterpret_cast<unsigned char*>(bytes.data()), bytes_of(text), static_cast<int>(text.size()));
  if (size < 0) return std::nullopt;
  const std::size_t padding = text.ends_with("==") ? 2 : text.ends_with('=') ? 1 : 0;
  bytes.resize(static_cast<std::size_t>(size) - padding);
  if (base64_of(bytes) != text) return std::nullopt;
  return bytes;
}

// What is signed: DSSE's pre-authentication encoding.
std::string signed_bytes(std::string_view type, std::string_view payload) {
  return fmt::format("DSSEv1 {} {} {} {}", type.size(), type, payload.size(), payload);
}

bool is_signed_by(const Json& envelope, std::string_view payload, EVP_PKEY* key) {
  const std::string message = signed_bytes(kPayloadType, payload);
  return std::ranges::any_of(envelope.at("signatures"), [&](const Json& one) {
    if (!one.is_object() || !one.contains("sig") || !one.at("sig").is_string()) return false;
    const auto signature = bytes_of_base64(one.at("sig").get<std::string>());
    if (!signature || signature->size() != kSignatureBytes) return false;
    const Digest digest(EVP_MD_CTX_new(), &EVP_MD_CTX_free);
    return EVP_DigestVerifyInit(digest.get(), nullptr, nullptr, nullptr, key) == 1 &&
           EVP_DigestVerify(digest.get(), bytes_of(*signature), signature->size(), bytes_of(message), message.size()) ==
               1;
  });
}

}  // namespace

std::string text_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

std::expected<std::string, std::string> seal_envelope(const std::string& statement, std::string_view private_key_pem) {
  const auto key = key_of(private_key_pem, "private", PEM_read_bio_PrivateKey);
  if (!key) return std::unexpected(key.error());
  const std::string message = signed_bytes(kPayloadType, statement);
  std::string signature(kSignatureBytes, '\0');
  std::size_t size = signature.size();
  const Digest digest(EVP_MD_CTX_new(), &EVP_MD_CTX_free);
  if (EVP_DigestSignInit(digest.get(), nullptr, nullptr, nullptr, key->get()) != 1 ||
      EVP_DigestSign(digest.get(), reinterpret_cast<unsigned char*>(signature.data()), &size, bytes_of(message),
                     message.size()) != 1)
    return std::unexpected("OpenSSL cannot sign with that key");
  const Json envelope{{"payloadType", kPayloadType},
                      {"payload", base64_of(statement)},
                      {"signatures", Json::array({Json{{"keyid", id_of(key->get())}, {"sig", base64_of(signature)}}})}};
  return envelope.dump(2) + "\n";
}

std::expected<OpenedEnvelope, std::string> open_envelope(const std::string& text, const std::string& file,
                                                         std::string_view public_key_pem) {
  const auto key = key_of(public_key_pem, "public", PEM_read_bio_PUBKEY);
  if (!key) return std::unexpected("the key file is none: " + key.error());
  if (text.size() > kLargestEnvelope) return std::unexpected(fmt::format("{} is too large", file));
  const auto envelope = monitor::parse_strict(text);
  if (!envelope) return std::unexpected(fmt::format("{} is {}", file, envelope.error()));
  if (!envelope->is_object() || text_at(*envelope, "payloadType") != kPayloadType ||
      !envelope->contains("signatures") || !envelope->at("signatures").is_array())
    return std::unexpected(fmt::format("{} is no DSSE envelope around an in-toto statement", file));
  const auto payload = bytes_of_base64(text_at(*envelope, "payload"));
  if (!payload) return std::unexpected(fmt::format("the payload of {} is not base64", file));
  if (!is_signed_by(*envelope, *payload, key->get()))
    return std::unexpected(fmt::format("{} is not signed by that key", file));
  auto statement = monitor::parse_strict(*payload);
  if (!statement) return std::unexpected(fmt::format("what {} signs is {}", file, statement.error()));
  if (!statement->is_object() || text_at(*statement, "_type") != kStatementType)
    return std::unexpected(fmt::format("what {} signs is no in-toto statement", file));
  return OpenedEnvelope{id_of(key->get()), std::move(*statement)};
}

}  // namespace takt::lab
