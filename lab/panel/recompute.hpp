// SPDX-License-Identifier: Apache-2.0
// Rows of an artifact, computed anew from its panel file: who edited a row, or what computed it, does not get the same
// bytes. Which rows, the caller draws, so that they were unknown when the artifact was made.
//
// Real-time rows are measured anew: their processes ran once, and the kept run folder has to be as it was recorded, to
// replay, and to give the same row. Errors are one sentence. Thread rule: call from a process of one
// thread.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <vector>

#include "lab/artifact/artifact.hpp"
#include "lab/judge/audit.hpp"
#include "lab/panel/panel_plan.hpp"

namespace takt::lab {

// Indices of `count` different rows of `rows`, by the nonce.
std::vector<std::size_t> drawn_rows(std::size_t count, std::size_t rows, std::uint64_t nonce);

// Of a panel, what the artifact holds: its tasks, its methods and its seeds.
void keep_what_ran(const ArtifactManifest& manifest, Panel& panel);

// `contest`: of the panel file that the artifact was made from; refused where it is another. Host fields are not
// compared.
std::expected<Recomputed, std::string> recompute(const Artifact& artifact, Contest& contest,
                                                 const std::vector<std::size_t>& rows, std::size_t workers);

}  // namespace takt::lab
