// SPDX-License-Identifier: Apache-2.0
// What an artifact's files were when the program wrote them. A seal without a key shows an edit to a keeper of the
// artifact id, and to no forger: what the rows say is proved by computing some of them anew (takt audit --recompute).
//
//   rollouts.sha256   a line per row: SHA-256 over the line before and the row, in hexadecimal
//   seal.json         SHA-256 of every file of a finished artifact, those of kept run folders (runs/) included, but the
//                     seal itself, postmortems/, which people write after it, and inputs/, whose files are named by
//                     their hashes
#pragma once

#include <cstddef>
#include <expected>
#include <string>
#include <string_view>
#include <vector>

namespace takt::lab {

class ArtifactFolder;

inline constexpr const char* kSealSchema = "takt.seal/1";

// The seal of a row, line end included, behind the one before; `before`: empty for the first.
std::string row_seal(std::string_view before, std::string_view row);
// Why the seals are not those of the rows; empty: they are. `may_lack_last`: the newest row's may be missing, as while
// it is written.
std::string broken_row_seal(std::string_view rows, std::string_view seals, bool may_lack_last);

// seal.json of a finished artifact, from its files as they lie there.
std::expected<std::string, std::string> seal_of(const ArtifactFolder& folder, const std::string& artifact_id);
// Why the artifact's own files are not those that seal.json names; empty: they are. Run folders are not looked at, so
// that rows can be read where the recordings stay elsewhere.
std::string broken_seal(const ArtifactFolder& folder, const std::string& artifact_id);

// The files of kept run folders. What came to lie beside them later, such as a report, is no part of the seal.
struct SealedRuns {
  std::size_t files = 0;             // that the seal names
  std::vector<std::string> altered;  // sentences: what is not there, or not the file that was sealed
};
// Precondition: the seal is whole (broken_seal).
SealedRuns look_at_runs(const ArtifactFolder& folder);

}  // namespace takt::lab
