// SPDX-License-Identifier: Apache-2.0
// What a panel was to show, signed before it ran: seeds, methods, bounds, conditions, and the comparison that was to
// decide. A choice that was made after rows were seen shows by it.
//
// The file is an envelope (lab/artifact/envelope.hpp) whose statement holds panel.yaml's text and the manifest that
// an artifact of it would have; a time stamp may lie beside it (lab/artifact/time_stamp.hpp). Beside PANEL.yaml they
// are PANEL.registration.dsse.json and PANEL.registration.tsr, in an artifact registration.dsse.json and
// registration.tsr. Errors are one sentence. Thread rule: one thread.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>
#include <string>
#include <string_view>

#include "lab/judge/audit.hpp"
#include "lab/panel/panel_plan.hpp"

namespace takt::lab {

// `b` against `a`, as `takt compare --margin` decides it: between 0 and 1 of success.
struct RegisteredComparison {
  std::string a, b;
  double margin = 0;
};

struct RegistrationFiles {
  std::string envelope, stamp;  // paths
};
RegistrationFiles registration_beside(const std::string& panel_file);

// The envelope's text. `manifest`: of the contest, with what the command line decides (until_decided).
std::expected<std::string, std::string> registration_text(const Contest& contest, const ArtifactManifest& manifest,
                                                          const std::optional<RegisteredComparison>& comparison,
                                                          std::int64_t unix_ns, std::string_view private_key_pem);

// Copies what is registered beside the panel file into the artifact; nothing where nothing is.
std::expected<void, std::string> keep_registration(const std::string& panel_file, const ArtifactFolder& folder);

// Of an artifact that keeps a registration, signed by that key. `certificates_pem`: of time-stamping authorities, where
// the reader named some: a stamp beside it has to be of one of them.
std::expected<Registered, std::string> check_registration(const Artifact& artifact, std::string_view public_key_pem,
                                                          const std::optional<std::string>& certificates_pem);

}  // namespace takt::lab
