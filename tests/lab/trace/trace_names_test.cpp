// SPDX-License-Identifier: Apache-2.0
// Goal: a reader of Takt's traces by name finds names that exist. Method: the provider's header is the source. The
// events and fields it defines are compared with the list the review reads by; every event, field, mode and defined
// value that the Trace Compass analysis (docs/trace-compass/takt.xml) speaks of is looked up; docs/tracing.md must
// explain every event and field.
#include <gtest/gtest.h>

#include <map>
#include <regex>
#include <set>
#include <string>

#include "executive/contract/mode.hpp"
#include "lab/trace/trace_event.hpp"
#include "tests/support/files.hpp"

namespace takt::monitor {
namespace {

using Names = std::set<std::string>;
using Events = std::map<std::string, Names>;

using test::text_of;

// Every match's first group.
Names all(const std::string& text, const std::string& pattern) {
  Names found;
  const std::regex wanted(pattern);
  for (std::sregex_iterator match(text.begin(), text.end(), wanted), end; match != end; ++match)
    found.insert((*match)[1]);
  return found;
}

Names fields_in(const std::string& text) {
  return all(text, R"((?:lttng_ust_field_integer|lttng_ust_field_integer_hex)\([^,]+, (\w+),)");
}

Events provider() {
  const std::string text = text_of("executive/trace/provider.hpp");
  Events events;
  const std::regex event(R"(LTTNG_UST_TRACEPOINT_EVENT(_CLASS)?\(takt, (\w+),)");
  std::map<std::string, Names> classes;
  for (std::sregex_iterator match(text.begin(), text.end(), event), end; match != end; ++match) {
    const auto begin = static_cast<std::size_t>(match->position());
    const std::string body = text.substr(begin, text.find(")))", begin) - begin);
    Names fields = fields_in(body);
    fields.merge(all(body, R"(lttng_ust_field_string\((\w+),)"));
    ((*match)[1].matched ? classes : events)[(*match)[2]] = fields;
  }
  for (const std::string& instance : all(text, R"(TAKT_INFERENCE_EVENT\((infer_\w+)\))"))
    events[instance] = classes.at("inference");
  return events;
}

TEST(TraceNames, TheReviewReadsWhatTheProviderWrites) {
  Events read;
  for (const lab::TraceEventShape& shape : lab::trace_events()) {
    EXPECT_EQ(static_cast<std::size_t>(shape.event), read.size()) << "not in the order of EventName: " << shape.name;
    read[std::string(shape.name)] = Names(shape.fields.begin(), shape.fields.end());
    EXPECT_EQ(read.size(), static_cast<std::size_t>(shape.event) + 1) << "twice: " << shape.name;
  }
  EXPECT_EQ(read, provider());
}

TEST(TraceNames, TraceCompassAsksForNothingElse) {
  const Events events = provider();
  const std::string text = text_of("docs/trace-compass/takt.xml");
  const std::regex handler(R"re(<eventHandler eventName="takt:(\w+)">([^]*?)</eventHandler>)re");
  std::size_t handlers = 0;
  for (std::sregex_iterator match(text.begin(), text.end(), handler), end; match != end; ++match, ++handlers) {
    const auto event = events.find((*match)[1]);
    ASSERT_NE(event, events.end()) << (*match)[1];
    for (const std::string& field : all((*match)[2], R"re(type="eventField" value="([\w.]+)")re")) {
      EXPECT_TRUE(field == "context._vpid" || event->second.contains(field)) << (*match)[1] << "." << field;
    }
  }
  EXPECT_EQ(handlers, all(text, R"(<eventHandler eventName="([^"]*))").size()) << "a handler that is not one of ours";
  EXPECT_GT(handlers, 5U);
}

TEST(TraceNames, TraceCompassCallsModesByTheirNames) {
  const std::string text = text_of("docs/trace-compass/takt.xml");
  for (std::size_t mode = 0; mode < kModeCount; ++mode) {
    std::string shown(name(static_cast<Mode>(mode)));
    for (char& letter : shown) letter = static_cast<char>(std::toupper(static_cast<unsigned char>(letter)));
    const std::string value = "name=\"" + shown + "\" value=\"" + std::to_string(mode) + "\"";
    const std::size_t first = text.find(value);
    ASSERT_NE(first, std::string::npos) << value << " in the view";
    EXPECT_NE(text.find(value, first + 1), std::string::npos) << value << " in the state provider";
  }
  const Names defined = all(text, R"re(<definedValue name="(\w+)" value)re");
  for (const std::string& used : all(text, R"re(value="\$(\w+)")re")) EXPECT_TRUE(defined.contains(used)) << used;
  const Names written = all(text, R"re(<stateAttribute type="constant" value="(\w+)")re");
  for (const std::string& shown : all(text, R"re(<display type="constant" value="(\w+)")re"))
    EXPECT_TRUE(written.contains(shown)) << shown;
}

TEST(TraceNames, EveryEventAndFieldIsExplained) {
  const std::string text = text_of("docs/tracing.md");
  for (const auto& [event, fields] : provider()) {
    EXPECT_NE(text.find("`" + event + "`"), std::string::npos) << event;
    for (const std::string& field : fields)
      EXPECT_NE(text.find("`" + field + "`"), std::string::npos) << event << "." << field;
  }
}

}  // namespace
}  // namespace takt::monitor
