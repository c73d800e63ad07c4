// SPDX-License-Identifier: Apache-2.0
#include "dds/domain_xml.hpp"

#include <fmt/format.h>

namespace takt::dds {

// Participants on one machine that are found by unicast need ports of their own: a participant index each, of which
// others try the first MaxAutoParticipantIndex. Shared memory stays off: Debian's build could offer it.
std::string domain_xml(const config::Dds& dds) {
  std::string peers;
  if (dds.interface == "lo") peers += R"(<Peer Address="localhost"/>)";
  for (const config::DdsPeer& peer : dds.peers) peers += fmt::format(R"(<Peer Address="{}"/>)", peer.address);
  return fmt::format(R"(<CycloneDDS><Domain id="{}">)"
                     R"(<General><Interfaces><NetworkInterface name="{}" multicast="{}"/></Interfaces>)"
                     R"(<AllowMulticast>{}</AllowMulticast></General>)"
                     R"(<Discovery><ParticipantIndex>auto</ParticipantIndex>)"
                     R"(<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers>{}</Peers></Discovery>)"
                     R"(<SharedMemory><Enable>false</Enable></SharedMemory>)"
                     R"(</Domain></CycloneDDS>)",
                     dds.domain, dds.interface, dds.multicast ? "default" : "false", dds.multicast, peers);
}

}  // namespace takt::dds
