// SPDX-License-Identifier: Apache-2.0
#include "dds/domain.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <set>
#include <utility>

#include "config/dds_security.hpp"
#include "dds/domain_xml.hpp"
#include "dds/neighbours.hpp"

namespace takt::dds {
namespace {

// Debian keeps the security plugins beside the library, where the loader does not look.
std::string plugin_folder() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&dds_create_domain), &info) == 0 || info.dli_fname == nullptr) return {};
  std::string folder = std::filesystem::path(info.dli_fname).parent_path() / "libddsc0debian";
  std::error_code ignored;
  return std::filesystem::exists(folder, ignored) ? folder : std::string{};
}

}  // namespace

std::string Domain::where(const config::RobotConfig& robot) {
  return fmt::format("domain {}, interface {}; see `dds` in {}", robot.dds->domain, robot.dds->interface, robot.file);
}

std::string Domain::failure(std::string_view what, dds_entity_t refused) const {
  return fmt::format("{}: {} ({})", what, dds_strretcode(-refused), where_);
}

std::expected<Domain, std::string> Domain::open(const config::RobotConfig& robot, const std::string& name) {
  // Cyclone's own word about a file is a line of its log.
  if (std::string why = config::unreadable_security_file(*robot.dds); !why.empty()) return std::unexpected(why);
  Domain made(robot);
  log_within_budget();
  const std::set<int> before = datagram_sockets();
  made.domain_ = dds_create_domain(robot.dds->domain, domain_xml(*robot.dds, plugin_folder()).c_str());
  if (made.domain_ <= 0) return std::unexpected(made.failure("domain", made.domain_));
  const Qos qos = make_qos();
  dds_qset_entity_name(qos.get(), name.c_str());
  made.participant_ = dds_create_participant(robot.dds->domain, qos.get(), nullptr);
  if (made.participant_ <= 0) return std::unexpected(made.failure("participant", made.participant_));
  std::set<int> opened;
  std::ranges::set_difference(datagram_sockets(), before, std::inserter(opened, opened.end()));
  if (opened.empty() || !hear_only(opened, robot.dds->interface))
    return std::unexpected(fmt::format("its sockets cannot be kept to their interface ({})", made.where_));
  return made;
}

Domain::Domain(Domain&& other) noexcept
    : where_(std::move(other.where_)), domain_(std::exchange(other.domain_, 0)), participant_(other.participant_) {}

Domain::~Domain() {
  if (domain_ > 0) dds_delete(domain_);
}

}  // namespace takt::dds
