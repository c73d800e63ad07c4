// SPDX-License-Identifier: Apache-2.0
// In the place of otlp_sender.cpp where the build leaves HTTP out (TAKT_WITH_OTLP).
#include <utility>

#include "monitor/telemetry/otlp_sender.hpp"

namespace takt::monitor {

bool OtlpSender::is_built_in() {
  return false;
}

OtlpSender::OtlpSender(const std::string& endpoint) : OtlpSender(endpoint, Patience{}) {}

OtlpSender::OtlpSender(const std::string& /*endpoint*/, Patience /*patience*/) {
  std::unreachable();
}

OtlpSender::~OtlpSender() = default;

void OtlpSender::post(OtlpSignal /*signal*/, std::string /*body*/) {}

OtlpDeliveries OtlpSender::deliveries() const {
  return {};
}

}  // namespace takt::monitor
