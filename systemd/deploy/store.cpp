// SPDX-License-Identifier: Apache-2.0
#include "systemd/deploy/store.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

#include "config/hash.hpp"
#include "config/load.hpp"
#include "config/policy_signature.hpp"
#include "config/sha256.hpp"

namespace takt::deploy {
namespace {

namespace fs = std::filesystem;
using Done = std::expected<void, std::string>;

std::unexpected<std::string> cannot(const std::string& what, const std::string& path, const std::string& why) {
  return std::unexpected(
      fmt::format("{} cannot be {}: {}; run as root, make room, or name another --store", path, what, why));
}

Done sync_path(const std::string& path) {
  const ipc::Descriptor opened(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!opened.is_open() || fsync(opened.get()) != 0) return cannot("written to disk", path, std::strerror(errno));
  return {};
}

// Whatever the umask: the robot's processes are other users.
Done readable_by_all(const std::string& path) {
  const mode_t mode = fs::is_directory(path) ? 0755 : 0644;
  if (::chmod(path.c_str(), mode) != 0) return cannot("opened to its readers", path, std::strerror(errno));
  return sync_path(path);
}

Done write_file(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file << text;
  file.close();
  if (!file) return cannot("written", path, std::strerror(errno));
  return readable_by_all(path);
}

// A regular file and no link to one: who wrote the robot file may not have read it, and everybody reads the copy.
Done copy_file(const std::string& from, const std::string& to) {
  constexpr std::size_t kPiece = std::size_t{1} << 30U;
  const ipc::Descriptor source(::open(from.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (!source.is_open() && errno == ELOOP)
    return std::unexpected(fmt::format("{} is a link: name the file that it points to, or copy that here", from));
  struct stat status {};
  if (!source.is_open() || ::fstat(source.get(), &status) != 0) return cannot("read", from, std::strerror(errno));
  if (!S_ISREG(status.st_mode)) return std::unexpected(fmt::format("{} is not a regular file", from));
  const ipc::Descriptor copy(::open(to.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0644));
  if (!copy.is_open()) return cannot("written", to, std::strerror(errno));
  ssize_t moved = 0;
  while ((moved = ::sendfile(copy.get(), source.get(), nullptr, kPiece)) > 0) {
  }
  if (moved < 0) return cannot("copied to " + to, from, std::strerror(errno));
  return readable_by_all(to);
}

struct PolicyCopy {
  std::string key, from;
  std::string folder;  // in the deployment; empty: the deployment's own
  [[nodiscard]] std::string path() const { return (fs::path(folder) / fs::path(from).filename()).string(); }
};

// Each that is not the first in a folder of its own: two files may have one name.
std::vector<PolicyCopy> policies_of(const config::RobotConfig& robot) {
  std::vector<PolicyCopy> policies;
  if (robot.policy) policies.push_back({"policy.file", robot.policy->file, ""});
  for (const config::Fallback& fallback : robot.fallbacks)
    if (fallback.has_own_file())
      policies.push_back({"fallbacks." + fallback.name + ".file", fallback.file, "fallback-" + fallback.name});
  return policies;
}

constexpr const char* kPolicyKey = "signed_by.pem";

// With the weights beside it, under its own names: the policy names them. And with its signature.
Done copy_policy(const PolicyCopy& policy, const std::string& deployment, bool is_signed) {
  const std::string folder = (fs::path(deployment) / policy.folder).string();
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return cannot("made", folder, error.message());
  if (auto done = policy.folder.empty() ? Done{} : readable_by_all(folder); !done) return done;
  for (const std::string& file : config::policy_files(policy.from)) {
    if (auto done = copy_file(file, (fs::path(folder) / fs::path(file).filename()).string()); !done) return done;
  }
  const std::string signature = config::signature_of_policy(policy.from);
  if (!is_signed || !fs::exists(signature)) return {};
  return copy_file(signature, (fs::path(folder) / fs::path(signature).filename()).string());
}

// What a panel showed of it goes with the robot; one that is not there is not, and `takt config check` says so.
struct AttestationCopy {
  std::string key, from, name;
};

std::vector<AttestationCopy> attestations_of(const config::RobotConfig& robot) {
  std::vector<AttestationCopy> copies;
  const auto add = [&](const std::string& of, const std::string& from) {
    if (config::is_shown(from) && fs::exists(from)) copies.push_back({of + ".shown_by", from, "shown/" + of + ".json"});
  };
  for (const config::Fallback& fallback : robot.fallbacks) add("fallbacks." + fallback.name, fallback.shown_by);
  for (const config::StopConfig& stop : robot.stops) add("stops." + stop.name, stop.shown_by);
  return copies;
}

Done copy_attestation(const AttestationCopy& attestation, const std::string& deployment) {
  std::error_code error;
  fs::create_directories(deployment + "/shown", error);
  if (error) return cannot("made", deployment + "/shown", error.message());
  if (auto done = readable_by_all(deployment + "/shown"); !done) return done;
  return copy_file(attestation.from, deployment + "/" + attestation.name);
}

// Last part of where a link points; empty: no link, or it points nowhere.
std::string link_name(const std::string& link) {
  std::error_code error;
  if (!fs::exists(link, error)) return {};
  const fs::path target = fs::read_symlink(link, error);
  return error ? std::string() : target.filename().string();
}

// A line for each file of a deployment, in the order of their names.
std::expected<std::string, std::string> hashes_of(const std::string& deployment) {
  std::vector<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(deployment))
    if (entry.is_regular_file()) names.push_back(entry.path().lexically_relative(deployment));
  std::ranges::sort(names);
  std::string lines;
  for (const std::string& name : names) {
    const auto sha256 = config::file_sha256(fmt::format("{}/{}", deployment, name));
    if (!sha256) return std::unexpected(fmt::format("{}/{} {}", deployment, name, sha256.error()));
    lines += fmt::format("{}  {}\n", *sha256, name);
  }
  return lines;
}

// The first of several steps that fails.
template <class... Steps>
Done in_turn(Steps&&... steps) {
  Done done;
  (void)((done = steps(), done.has_value()) && ...);
  return done;
}

Done check_name(const std::string& name) {
  constexpr const char* kAllowed = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.";
  constexpr std::size_t kLongest = 100;
  const bool fits = !name.empty() && name.size() <= kLongest && name.front() != '.' &&
                    name.find_first_not_of(kAllowed) == std::string::npos;
  if (fits) return {};
  return std::unexpected(fmt::format("`{}` is no name for a deployment: write at most {} letters, digits, _ - .",
                                     name.substr(0, kLongest), kLongest));
}

}  // namespace

std::expected<Store, std::string> Store::open(const std::string& folder, std::function<void()> on_step) {
  for (const std::string& made : {folder, folder + "/deployments"}) {
    std::error_code error;
    if (fs::exists(made, error)) continue;
    fs::create_directories(made, error);
    if (error) return cannot("made", made, error.message());
    if (const Done readable = readable_by_all(made); !readable) return std::unexpected(readable.error());
  }
  // Its owner alone may open it: a lock that others can hold keeps a robot from its way back.
  const std::string lock_file = folder + "/.lock";
  ipc::Descriptor lock(::open(lock_file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, S_IRUSR | S_IWUSR));
  if (!lock.is_open()) return cannot("opened", lock_file, std::strerror(errno));
  if (flock(lock.get(), LOCK_EX | LOCK_NB) != 0)
    return std::unexpected(fmt::format("another takt deploy or rollback works on {}: wait until it ends", folder));
  return Store(folder, std::move(lock), std::move(on_step));
}

std::string Store::current() const {
  return link_name(folder_ + "/robot");
}

std::string Store::previous() const {
  return link_name(folder_ + "/robot/previous");
}

std::expected<std::string, std::string> Store::robot_file(const std::string& name) const {
  if (const Done named = check_name(name); !named) return std::unexpected(named.error());
  std::string file = deployments() + "/" + name + "/robot.yaml";
  if (fs::exists(file)) return file;
  return std::unexpected(fmt::format("{}/{} holds no robot file: `{}` was never deployed", deployments(), name, name));
}

Done Store::is_as_tried(const std::string& name) const {
  const std::string folder = deployments() + "/" + name;
  std::ifstream tried(folder + "/tried");
  for (std::string line; std::getline(tried, line);) {
    const std::size_t end = line.find("  ");
    if (end == std::string::npos) return std::unexpected(fmt::format("{}/tried is damaged", folder));
    const std::string file = folder + "/" + line.substr(end + 2);
    if (config::file_sha256(file).value_or("") != line.substr(0, end))
      return std::unexpected(fmt::format("{} is another than was tried: deploy the robot anew", file));
  }
  return {};
}

bool Store::is_proven(const std::string& name) const {
  return fs::exists(deployments() + "/" + name + "/proven");
}

// Paths in the copy are the copy's own, so that neither an edited policy nor a moved folder changes what is deployed.
Done Store::fill(const std::string& staging, const Newcomer& newcomer) {
  const std::vector<PolicyCopy> policies = policies_of(newcomer.robot);
  std::vector<config::Override> own;
  for (const PolicyCopy& policy : policies) own.push_back({policy.key, policy.path()});
  const std::vector<AttestationCopy> attestations = attestations_of(newcomer.robot);
  for (const AttestationCopy& attestation : attestations) own.push_back({attestation.key, attestation.name});
  const bool is_signed = newcomer.robot.policy && newcomer.robot.policy->names_key();
  if (is_signed) own.push_back({"policy.signed_by", kPolicyKey});
  own.push_back({"record.directory", newcomer.runs_folder});
  const auto copy = config::with_overrides(newcomer.robot, own);
  if (!copy) return std::unexpected(copy.error());
  const auto stepping = [this](Done done) {
    stepped();
    return done;
  };
  const std::string before = current(), original = fs::canonical(newcomer.robot.file).string();  // named by a person
  return in_turn([&] { return stepping(write_file(staging + "/robot.yaml", copy->resolved)); },
                 [&] { return stepping(copy_file(original, staging + "/original.yaml")); },
                 [&] {
                   Done done;
                   for (const PolicyCopy& policy : policies)
                     if (done) done = stepping(copy_policy(policy, staging, is_signed));
                   if (done && is_signed)
                     done = stepping(copy_file(newcomer.robot.policy->signed_by, staging + "/" + kPolicyKey));
                   for (const AttestationCopy& attestation : attestations)
                     if (done) done = stepping(copy_attestation(attestation, staging));
                   return done;
                 },
                 [&] {
                   return newcomer.simulated
                              ? stepping(write_file(staging + "/simulated", "takt-plant plays this robot\n"))
                              : Done{};
                 },
                 [&] { return before.empty() ? Done{} : link("../" + before, staging + "/previous"); });
}

// What was tried is written down beside it.
Done Store::try_copy(const std::string& staging, const TryOut& try_out) {
  if (Done tried = try_out ? try_out(staging + "/robot.yaml") : Done{}; !tried) return tried;
  const auto hashes = hashes_of(staging);
  if (!hashes) return std::unexpected(hashes.error());
  Done written = write_file(staging + "/tried", *hashes);
  stepped();
  return written;
}

Done Store::add(const Newcomer& newcomer, const TryOut& try_out) {
  const std::string folder = deployments() + "/" + newcomer.name;
  if (Done named = check_name(newcomer.name); !named) return named;
  if (fs::exists(folder)) return std::unexpected(fmt::format("{} exists already: choose another --name", folder));
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(deployments(), error))
    if (entry.path().filename().string().starts_with(".staging-")) fs::remove_all(entry.path(), error);
  const std::string staging = deployments() + "/.staging-" + newcomer.name;
  if (::mkdir(staging.c_str(), S_IRWXU) != 0) return cannot("made", staging, std::strerror(errno));
  stepped();
  const Done ready = in_turn([&] { return fill(staging, newcomer); }, [&] { return try_copy(staging, try_out); },
                             [&] { return readable_by_all(staging); });
  if (!ready) {
    fs::remove_all(staging, error);
    return ready;
  }
  if (std::rename(staging.c_str(), folder.c_str()) != 0) return cannot("renamed", staging, std::strerror(errno));
  stepped();
  return sync_path(deployments());
}

Done Store::link(const std::string& target, const std::string& path) {
  const std::string draft = path + ".new";
  std::error_code error;
  fs::remove(draft, error);
  fs::create_directory_symlink(target, draft, error);
  if (error) return cannot("linked", path, error.message());
  stepped();
  if (std::rename(draft.c_str(), path.c_str()) != 0) return cannot("linked", path, std::strerror(errno));
  stepped();
  return {};
}

Done Store::use(const std::string& name) {
  if (const auto file = robot_file(name); !file) return std::unexpected(file.error());
  std::error_code error;
  const std::string robot = folder_ + "/robot";
  if (fs::exists(fs::symlink_status(robot, error)) && !fs::is_symlink(robot, error))
    return std::unexpected(fmt::format("{} is not a link: move it away, it is what deployments replace", robot));
  return in_turn([&] { return link("deployments/" + name, robot); }, [&] { return sync_path(folder_); });
}

Done Store::mark_proven(const std::string& name) {
  return write_file(deployments() + "/" + name + "/proven", "passed its probation\n");
}

}  // namespace takt::deploy
