// SPDX-License-Identifier: Apache-2.0
#include "config/dds_security.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace takt::config {

std::string unreadable_security_file(const Dds& dds) {
  if (dds.security.empty()) return {};
  for (const char* const file : kSecurityFiles)
    if (const std::string path = dds.security + "/" + file; access(path.c_str(), R_OK) != 0)
      return fmt::format("dds.security: {}: {}; docs/ros2.md says how to make it", path,
                         std::generic_category().message(errno));
  return {};
}

}  // namespace takt::config
