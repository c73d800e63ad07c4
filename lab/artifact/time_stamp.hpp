// SPDX-License-Identifier: Apache-2.0
// When a signature was there: a time stamp of RFC 3161 over the bytes of its envelope, and so over all that the
// envelope names.
//
// Read is a whole response (`openssl ts -reply`, DER), as time-stamping authorities send it, whose imprint is SHA-256.
// Its signer has to be certified for time stamping, at the time that the stamp states. Errors are one sentence. Thread
// rule: any thread.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <string_view>

namespace takt::lab {

inline constexpr const char* kTimeStampFile = "seal.tsr";

struct TimeStamp {
  std::int64_t unix_s = 0;
  std::string by;  // the signer's name, RFC 2253; printable
};

// As the response says it, by any authority. Refused where it stamps other bytes. `file`: of those bytes, for the
// sentence.
std::expected<TimeStamp, std::string> claimed_time(std::string_view response, std::string_view stamped,
                                                   const std::string& file);

// And it is signed by an authority that one of the certificates vouches for (PEM, one behind the other).
std::expected<TimeStamp, std::string> checked_time(std::string_view response, std::string_view stamped,
                                                   const std::string& file, std::string_view certificates_pem);

}  // namespace takt::lab
