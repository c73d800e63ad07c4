// SPDX-License-Identifier: Apache-2.0
#include "dds/domain_xml.hpp"

#include <fmt/format.h>

#include "config/dds_security.hpp"

namespace takt::dds {
namespace {

// ROS 2's names of the files: its tools make them, too.
std::string security_xml(const std::string& folder, const std::string& plugins) {
  const auto library = [&plugins](std::string_view file, std::string_view what) {
    return fmt::format(R"(<Library path="{}{}" initFunction="init_{}" finalizeFunction="finalize_{}"/>)",
                       plugins.empty() ? "" : plugins + "/lib", plugins.empty() ? file : fmt::format("{}.so", file),
                       what, what);
  };
  const auto file = [&folder](std::string_view element, std::string_view name) {
    return fmt::format("<{}>file:{}/{}</{}>", element, folder, name, element);
  };
  const auto& [identity_ca, certificate, key, permissions_ca, governance, permissions] = config::kSecurityFiles;
  return "<Security><Authentication>" + library("dds_security_auth", "authentication") +
         file("IdentityCA", identity_ca) + file("IdentityCertificate", certificate) + file("PrivateKey", key) +
         "</Authentication><AccessControl>" + library("dds_security_ac", "access_control") +
         file("PermissionsCA", permissions_ca) + file("Governance", governance) + file("Permissions", permissions) +
         "</AccessControl><Cryptographic>" + library("dds_security_crypto", "crypto") + "</Cryptographic></Security>";
}

}  // namespace

// Participants on one machine that are found by unicast need ports of their own: a participant index each, of which
// others try the first MaxAutoParticipantIndex. Shared memory stays off: Debian's build could offer it.
std::string domain_xml(const config::Dds& dds, const std::string& plugins) {
  std::string peers;
  if (dds.interface == "lo") peers += R"(<Peer Address="localhost"/>)";
  for (const config::DdsPeer& peer : dds.peers) peers += fmt::format(R"(<Peer Address="{}"/>)", peer.address);
  return fmt::format(R"(<CycloneDDS><Domain id="{}">)"
                     R"(<General><Interfaces><NetworkInterface name="{}" multicast="{}"/></Interfaces>)"
                     R"(<AllowMulticast>{}</AllowMulticast></General>)"
                     R"(<Discovery><ParticipantIndex>auto</ParticipantIndex>)"
                     R"(<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers>{}</Peers></Discovery>)"
                     R"(<SharedMemory><Enable>false</Enable></SharedMemory>{})"
                     R"(</Domain></CycloneDDS>)",
                     dds.domain, dds.interface, dds.multicast ? "default" : "false", dds.multicast, peers,
                     dds.security.empty() ? "" : security_xml(dds.security, plugins));
}

}  // namespace takt::dds
