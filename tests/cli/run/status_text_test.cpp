// SPDX-License-Identifier: Apache-2.0
// Goal: what answers at the executive's socket is shown, whatever it says. Method: a reply without an end to its texts,
// of bytes that a terminal obeys and of some that are no UTF-8, by every way in which it is told.
#include "cli/run/status_text.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "config/printable.hpp"

namespace takt::cli {
namespace {

TEST(StatusText, AReplyOfAnyBytesIsPrintable) {
  OperatorReply reply;
  reply.incident.tick = reply.incident.stands = 1;
  const auto spoil = [](char* text, std::size_t size) {
    std::memset(text, 0xFF, size);
    std::memcpy(text, "no\x1b[2J\nagain\xC2\x9b", 14);
  };
  spoil(reply.sentences, sizeof reply.sentences);
  spoil(reply.incident.where, sizeof reply.incident.where);
  spoil(reply.incident.sentence, sizeof reply.incident.sentence);
  const auto sentences = sentences_of(reply);
  ASSERT_EQ(sentences.size(), 2U);
  EXPECT_EQ(sentences[0], "no\\x1b[2J");
  EXPECT_EQ(sentences[1], config::printable(sentences[1]));
  EXPECT_TRUE(sentences[1].starts_with("again\\xc2\\x9b\\xff"));
  const std::string text = status_text(reply.status, reply.incident);
  EXPECT_EQ(text, config::printable(text));
  EXPECT_EQ(incident_sentence(reply.incident), config::printable(incident_sentence(reply.incident)));
  EXPECT_NO_THROW((void)status_json(reply.status, reply.incident).dump()) << "JSON is UTF-8";
}

// Goal: a robot whose bus is off, so that some of its drives have no power, is not told as enabled.
TEST(StatusText, DrivesWithoutPowerAreCounted) {
  StatusSnapshot status;
  const auto drives = [&](std::uint8_t enabled) {
    status.drive_count = 6;
    status.enabled_drives = enabled;
    const std::string text = status_text(status, {});
    const std::size_t at = text.find("drives     ");
    return text.substr(at + 11, text.find('\n', at) - at - 11);
  };
  EXPECT_EQ(drives(0), "disabled");
  EXPECT_EQ(drives(6), "enabled");
  EXPECT_EQ(drives(3), "3 of 6 enabled, the others have no power (takt top says which)");
  EXPECT_EQ(status_json(status, {})["enabled_drives"], 3);
}

}  // namespace
}  // namespace takt::cli
