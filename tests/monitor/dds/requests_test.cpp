// SPDX-License-Identifier: Apache-2.0
// Goal: the domain can ask for what it may ask for and nothing else, and its configuration says what the robot file
// says. Method: a table of requests; the text handed to Cyclone DDS.
#include "monitor/dds/requests.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "dds/domain_xml.hpp"

namespace takt::monitor::dds {
namespace {

constexpr std::int64_t kNow = 1'700'000'000'000'000'000;
const Address kHere{.robot = "arm6", .machine = "aa11"};

struct Case {
  const char* when;
  const char* verb;
  Duration sent_ago;
  std::optional<OperatorVerb> handed_on;
  const char* answer;
  friend void PrintTo(const Case& one, std::ostream* out) { *out << one.when; }
};

class EveryRequest : public testing::TestWithParam<Case> {};

TEST_P(EveryRequest, IsHandedOnOrAnsweredWithASentence) {
  const Case& one = GetParam();
  const auto verdict = judge({"arm6", "", 1, one.verb, kNow - one.sent_ago.ns}, kHere, kNow);
  ASSERT_EQ(verdict.has_value(), one.handed_on.has_value());
  if (verdict)
    EXPECT_EQ(*verdict, *one.handed_on);
  else
    EXPECT_EQ(verdict.error(), one.answer);
}

INSTANTIATE_TEST_SUITE_P(
    Requests, EveryRequest,
    testing::Values(Case{"arm, at once", "arm", milliseconds(1), OperatorVerb::arm, ""},
                    Case{"arm, clocks a little apart", "arm", milliseconds(-500), OperatorVerb::arm, ""},
                    Case{"arm, after a network's pause", "arm", milliseconds(2500), std::nullopt,
                         "sent 2.5 s ago by this machine's clock: send it again, or set the clocks"},
                    Case{"arm, from the future", "arm", seconds(-60), std::nullopt,
                         "sent 60.0 s in the future by this machine's clock: send it again, or set the clocks"},
                    Case{"arm, from before all clocks", "arm", Duration{INT64_MAX}, std::nullopt,
                         "sent 1700000000.0 s ago by this machine's clock: send it again, or set the clocks"},
                    Case{"stop", "stop", {}, OperatorVerb::stop, ""},
                    Case{"stop, a minute late", "stop", seconds(60), OperatorVerb::stop, ""},
                    Case{"reset",
                         "reset",
                         {},
                         std::nullopt,
                         "not by DDS: a stop or fault is cleared on the robot's machine, takt reset"},
                    Case{"nothing", "", {}, std::nullopt, "`` is no request; write arm or stop"},
                    Case{"another spelling", "Arm", {}, std::nullopt, "`Arm` is no request; write arm or stop"}));

// Thirty computers with one robot file: each judges the same request by itself.
TEST(Requests, OneRequestArmsOneOfThirtyNamesakes) {
  std::vector<std::string> machines;
  for (int i = 0; i < 30; ++i) machines.push_back("machine" + std::to_string(i));
  const auto armed_by = [&](const std::string& named) {
    int armed = 0;
    for (const std::string& machine : machines) {
      Address address{.robot = "arm6", .machine = machine};
      for (const std::string& other : machines)
        if (other != machine) address.namesakes.push_back(other);
      const Request request{"arm6", named, 1, "arm", kNow};
      if (is_for(request, address) && judge(request, address, kNow).has_value()) ++armed;
    }
    return armed;
  };
  EXPECT_EQ(armed_by("machine7"), 1);
  EXPECT_EQ(armed_by(""), 0);
  EXPECT_EQ(armed_by("another"), 0);
}

TEST(Requests, TheRefusalNamesTheMachines) {
  const Address address{.robot = "arm6", .machine = "aa11", .namesakes = {"bb22", "cc33"}};
  EXPECT_EQ(judge({"arm6", "", 1, "arm", kNow}, address, kNow).error(),
            "more than one robot is named arm6: write the machine into the request; this one is aa11, others are bb22, "
            "cc33");
  EXPECT_TRUE(judge({"arm6", "", 1, "stop", kNow}, address, kNow).has_value()) << "a stop is for every one of them";
  const Address twins{.robot = "arm6", .machine = "aa11", .namesakes = {"aa11"}};
  EXPECT_EQ(judge({"arm6", "aa11", 1, "arm", kNow}, twins, kNow).error(),
            "two robots named arm6 run on this machine (aa11): give each a name of its own");
}

TEST(Requests, AMachineHasOneNameAndDoesNotTellItsId) {
  const std::string name = machine_name();
  EXPECT_EQ(name.size(), 12U);
  EXPECT_EQ(name, machine_name());
}

TEST(Requests, AStrangersWordCannotForgeALine) {
  EXPECT_EQ(printable("arm"), "arm");
  EXPECT_EQ(printable("arm\n\x1b[2J\xc3\xa4"), "arm??[2J??");
  const std::string long_word = printable("stop" + std::string(1000, 'p'));
  EXPECT_EQ(long_word, "stoppppppppppppp");
  EXPECT_FALSE(judge({"arm6", "", 1, long_word, kNow}, kHere, kNow).has_value());
}

TEST(DomainXml, LoopbackNeedsNoMulticastAndFindsThisMachine) {
  config::Dds dds;
  dds.domain = 7;
  dds.interface = "lo";
  const std::string xml = takt::dds::domain_xml(dds);
  for (const char* part : {R"(<Domain id="7">)", R"(<NetworkInterface name="lo" multicast="false"/>)",
                           "<AllowMulticast>false</AllowMulticast>", R"(<Peers><Peer Address="localhost"/></Peers>)",
                           "<SharedMemory><Enable>false</Enable></SharedMemory>"})
    EXPECT_NE(xml.find(part), std::string::npos) << part << " is missing in " << xml;
}

TEST(DomainXml, AnotherInterfaceTellsItsPeersOnly) {
  config::Dds dds;
  dds.interface = "eth0";
  dds.multicast = true;
  dds.peers = {{"10.0.0.2"}, {"desk"}};
  const std::string xml = takt::dds::domain_xml(dds);
  for (const char* part :
       {R"(<NetworkInterface name="eth0" multicast="default"/>)", "<AllowMulticast>true</AllowMulticast>",
        R"(<Peers><Peer Address="10.0.0.2"/><Peer Address="desk"/></Peers>)"})
    EXPECT_NE(xml.find(part), std::string::npos) << part << " is missing in " << xml;
}

TEST(DomainXml, SecurityIsThereWhereAFolderIsNamed) {
  config::Dds dds;
  dds.interface = "lo";
  EXPECT_EQ(takt::dds::domain_xml(dds, "/usr/lib/plugins").find("<Security>"), std::string::npos);
  dds.security = "/etc/takt/dds";
  const std::string xml = takt::dds::domain_xml(dds, "/usr/lib/plugins");
  for (const char* part :
       {R"(<Library path="/usr/lib/plugins/libdds_security_auth.so" initFunction="init_authentication")",
        R"(<Library path="/usr/lib/plugins/libdds_security_ac.so" initFunction="init_access_control")",
        R"(<Library path="/usr/lib/plugins/libdds_security_crypto.so" initFunction="init_crypto")",
        "<PrivateKey>file:/etc/takt/dds/key.pem</PrivateKey>",
        "<Governance>file:/etc/takt/dds/governance.p7s</Governance>"})
    EXPECT_NE(xml.find(part), std::string::npos) << part << " is missing in " << xml;
  EXPECT_NE(takt::dds::domain_xml(dds).find(R"(<Library path="dds_security_auth")"), std::string::npos)
      << "else the loader finds them";
}

}  // namespace
}  // namespace takt::monitor::dds
