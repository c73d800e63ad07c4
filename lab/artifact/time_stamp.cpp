// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/time_stamp.hpp"

#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ts.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>
#include <time.h>

#include <memory>
#include <optional>

#include "config/load.hpp"
#include "config/printable.hpp"

namespace takt::lab {
namespace {

template <auto free>
struct Free {
  template <class T>
  void operator()(T* thing) const {
    free(thing);
  }
};
using Response = std::unique_ptr<TS_RESP, Free<TS_RESP_free>>;
using Verification = std::unique_ptr<TS_VERIFY_CTX, Free<TS_VERIFY_CTX_free>>;
using Store = std::unique_ptr<X509_STORE, Free<X509_STORE_free>>;
using Certificate = std::unique_ptr<X509, Free<X509_free>>;
using Bio = std::unique_ptr<BIO, Free<BIO_free_all>>;

constexpr std::size_t kLargestResponse = 64U << 10U;
constexpr std::size_t kLongestName = 199;  // characters that are shown

Bio bio_of(std::string_view bytes) {
  return Bio(BIO_new_mem_buf(bytes.data(), static_cast<int>(bytes.size())));
}

// None: it is no response, or more than one.
Response response_of(std::string_view bytes) {
  if (bytes.size() > kLargestResponse) return nullptr;
  const auto* at = reinterpret_cast<const unsigned char*>(bytes.data());
  const unsigned char* const end = at + bytes.size();
  Response response(d2i_TS_RESP(nullptr, &at, static_cast<long>(bytes.size())));
  if (at != end) return nullptr;
  return response;
}

bool is_imprint_of(TS_MSG_IMPRINT* imprint, std::string_view stamped) {
  const ASN1_OBJECT* algorithm = nullptr;
  X509_ALGOR_get0(&algorithm, nullptr, nullptr, TS_MSG_IMPRINT_get_algo(imprint));
  const ASN1_OCTET_STRING* const hash = TS_MSG_IMPRINT_get_msg(imprint);
  std::string hex;
  for (int i = 0; i < ASN1_STRING_length(hash); ++i) hex += fmt::format("{:02x}", ASN1_STRING_get0_data(hash)[i]);
  return OBJ_obj2nid(algorithm) == NID_sha256 && hex == config::sha256_hex(stamped);
}

// Of the certificate in the response that made the stamp; empty: the response has none.
std::string signer_of(TS_RESP* response) {
  const auto free_list = [](STACK_OF(X509) * list) { sk_X509_free(list); };
  const std::unique_ptr<STACK_OF(X509), decltype(free_list)> signers(
      PKCS7_get0_signers(TS_RESP_get_token(response), nullptr, 0), free_list);
  if (!signers || sk_X509_num(signers.get()) != 1) return {};
  const Bio name(BIO_new(BIO_s_mem()));
  X509_NAME_print_ex(name.get(), X509_get_subject_name(sk_X509_value(signers.get(), 0)), 0, XN_FLAG_RFC2253);
  char* text = nullptr;
  const long size = BIO_get_mem_data(name.get(), &text);
  return config::printable(std::string(text, static_cast<std::size_t>(size)).substr(0, kLongestName));
}

std::optional<std::int64_t> unix_s_of(const ASN1_GENERALIZEDTIME* time) {
  tm broken_down{};
  if (time == nullptr || ASN1_TIME_to_tm(time, &broken_down) != 1) return std::nullopt;
  return timegm(&broken_down);
}

struct Read {
  Response response;
  TimeStamp stamp;
};

std::expected<Read, std::string> read(std::string_view bytes, std::string_view stamped, const std::string& file) {
  Response response = response_of(bytes);
  TS_TST_INFO* const info = response ? TS_RESP_get_tst_info(response.get()) : nullptr;
  if (info == nullptr)
    return std::unexpected(
        "it is no granted response of RFC 3161; a token alone becomes one by `openssl ts -reply -token_in`");
  if (!is_imprint_of(TS_TST_INFO_get_msg_imprint(info), stamped))
    return std::unexpected(
        fmt::format("it stamps other bytes than {}, by SHA-256; ask for a stamp of the file as it is now", file));
  const auto unix_s = unix_s_of(TS_TST_INFO_get_time(info));
  std::string by = signer_of(response.get());
  if (!unix_s || by.empty())
    return std::unexpected("it holds no certificate of its signer; ask for one by `openssl ts -query -cert`");
  return Read{std::move(response), {.unix_s = *unix_s, .by = std::move(by)}};
}

std::expected<Store, std::string> store_of(std::string_view pem, std::int64_t at_unix_s) {
  Store store(X509_STORE_new());
  const Bio bio = bio_of(pem);
  int count = 0;
  while (const Certificate one{PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr)}) {
    if (X509_STORE_add_cert(store.get(), one.get()) != 1) break;
    ++count;
  }
  ERR_clear_error();
  if (count == 0) return std::unexpected("it holds no certificate in PEM form");
  X509_VERIFY_PARAM_set_time(X509_STORE_get0_param(store.get()), at_unix_s);
  return store;
}

std::string why_not() {
  const char* data = nullptr;
  int flags = 0;
  const unsigned long code = ERR_peek_last_error_all(nullptr, nullptr, nullptr, &data, &flags);
  const char* const reason = ERR_reason_error_string(code);
  std::string text = (flags & ERR_TXT_STRING) != 0 && data != nullptr && *data != '\0' ? data
                     : reason != nullptr                                               ? reason
                                                                                       : "OpenSSL does not say why";
  ERR_clear_error();
  return config::printable(text);
}

}  // namespace

std::expected<TimeStamp, std::string> claimed_time(std::string_view response, std::string_view stamped,
                                                   const std::string& file) {
  auto found = read(response, stamped, file);
  if (!found) return std::unexpected(found.error());
  return std::move(found->stamp);
}

std::expected<TimeStamp, std::string> checked_time(std::string_view response, std::string_view stamped,
                                                   const std::string& file, std::string_view certificates_pem) {
  auto found = read(response, stamped, file);
  if (!found) return std::unexpected(found.error());
  auto store = store_of(certificates_pem, found->stamp.unix_s);
  if (!store) return std::unexpected("the certificate file is none: " + store.error());
  const Verification verification(TS_VERIFY_CTX_new());
  TS_VERIFY_CTX_set_flags(verification.get(), TS_VFY_VERSION | TS_VFY_SIGNATURE | TS_VFY_DATA | TS_VFY_SIGNER);
  // Both are its own from here on.
  TS_VERIFY_CTX_set_data(verification.get(), bio_of(stamped).release());
  TS_VERIFY_CTX_set_store(verification.get(), store->release());
  if (TS_RESP_verify_response(verification.get(), found->response.get()) != 1)
    return std::unexpected("it is not stamped by that authority: " + why_not());
  return std::move(found->stamp);
}

}  // namespace takt::lab
