// SPDX-License-Identifier: Apache-2.0
#include "config/policy_signature.hpp"

#include <fmt/format.h>
#include <openssl/evp.h>
#include <openssl/pem.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <memory>

#include "config/document.hpp"
#include "config/hash.hpp"

namespace takt::config {
namespace {

constexpr std::size_t kSignatureBytes = 64, kDigestBytes = 32;
constexpr std::size_t kLargestKey = 64U << 10U;

struct Free {
  void operator()(BIO* bio) const { BIO_free(bio); }
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
  void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
};

std::expected<std::unique_ptr<EVP_PKEY, Free>, std::string> key_of(const std::string& path) {
  const auto pem = read_file(path);
  if (!pem) return std::unexpected(pem.error());
  const std::unique_ptr<BIO, Free> bio(
      BIO_new_mem_buf(pem->data(), static_cast<int>(std::min(pem->size(), kLargestKey))));
  std::unique_ptr<EVP_PKEY, Free> key(PEM_read_bio_PUBKEY(bio.get(), nullptr, nullptr, nullptr));
  if (!key || EVP_PKEY_get_id(key.get()) != EVP_PKEY_ED25519)
    return std::unexpected(fmt::format("{} holds no public key of Ed25519 in PEM form", path));
  return key;
}

bool is_signed(EVP_PKEY* key, const std::array<unsigned char, kDigestBytes>& digest, const std::string& signature) {
  const std::unique_ptr<EVP_MD_CTX, Free> context(EVP_MD_CTX_new());
  return EVP_DigestVerifyInit(context.get(), nullptr, nullptr, nullptr, key) == 1 &&
         EVP_DigestVerify(context.get(), reinterpret_cast<const unsigned char*>(signature.data()), signature.size(),
                          digest.data(), digest.size()) == 1;
}

}  // namespace

std::string signature_of_policy(const std::string& file) {
  return file + ".sig";
}

std::expected<std::string, std::string> accepted_policy_sha256(const Policy& policy) {
  auto sha256 = policy_sha256(policy.file);
  if (!sha256 || !policy.names_key()) return sha256;
  const auto key = key_of(policy.signed_by);
  if (!key) return std::unexpected(fmt::format("{}; correct `policy.signed_by`", key.error()));
  const auto signature = read_file(signature_of_policy(policy.file));
  if (!signature)
    return std::unexpected(fmt::format("{}: no signature: {}; sign it with the key of `policy.signed_by`", policy.file,
                                       signature.error()));
  if (signature->size() != kSignatureBytes)
    return std::unexpected(fmt::format("{} holds {} bytes, and a signature of Ed25519 has {}; sign the policy again",
                                       signature_of_policy(policy.file), signature->size(), kSignatureBytes));
  std::array<unsigned char, kDigestBytes> digest{};
  for (std::size_t i = 0; i < digest.size(); ++i)
    std::from_chars(&(*sha256)[2 * i], &(*sha256)[2 * i] + 2, digest[i], 16);
  if (!is_signed(key->get(), digest, *signature))
    return std::unexpected(fmt::format(
        "{} is not the file that the key of `policy.signed_by` signed; sign it again, or go back to the one that was",
        policy.file));
  return sha256;
}

}  // namespace takt::config
