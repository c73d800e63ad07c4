// SPDX-License-Identifier: Apache-2.0
// Another vendor's DDS, as a judge of what the monitor sends: Fast DDS with no types of ours. Payloads stay bytes until
// fast_messages.hpp decodes them with Fast CDR. Loopback only, discovery by unicast.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace takt::test {

using Payload = std::vector<char>;  // encapsulation included

struct Endpoint {
  std::string type;
  std::string user_data;
};

// A DDS domain that no other test of this machine has while this process lives.
std::uint32_t domain_of_this_test();

class FastDdsPeer {
 public:
  explicit FastDdsPeer(std::uint32_t domain);
  ~FastDdsPeer();
  FastDdsPeer(const FastDdsPeer&) = delete;
  FastDdsPeer& operator=(const FastDdsPeer&) = delete;

  void listen(const std::string& topic, const std::string& type);
  // All that came so far, oldest first.
  const std::vector<Payload>& received(const std::string& topic);

  void offer(const std::string& topic, const std::string& type);
  [[nodiscard]] bool is_matched(const std::string& offered_topic) const;
  bool send(const std::string& offered_topic, const Payload& payload);
  // As if written at `unix_ns`: the time stamp that DDS itself carries.
  bool send_as_of(std::int64_t unix_ns, const std::string& offered_topic, const Payload& payload);

  // What others have announced, by topic.
  [[nodiscard]] std::map<std::string, Endpoint> writers() const;
  [[nodiscard]] std::map<std::string, Endpoint> readers() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace takt::test
