// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/intervention_log.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <system_error>
#include <vector>

#include "config/document.hpp"
#include "config/load.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/contract/version.hpp"
#include "executive/ipc/descriptor.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::monitor {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kLongestLine = 1U << 20U;
constexpr std::size_t kMostChangedKeys = 200;
constexpr std::uint32_t kNoLogin = ~std::uint32_t{0};

std::string error_text() {
  return std::system_category().message(errno);
}

// Of audit(7): the user who logged in, which `sudo` does not change. None: a service, or a kernel that does not say.
std::optional<std::uint32_t> login_of(std::int64_t pid) {
  std::uint32_t uid = kNoLogin;
  std::ifstream(fmt::format("/proc/{}/loginuid", pid)) >> uid;
  return uid == kNoLogin ? std::nullopt : std::optional(uid);
}

Json who(std::int64_t pid, std::optional<std::uint32_t> uid, std::string_view process) {
  Json json = Json::object();
  if (pid > 0) json["pid"] = pid;
  if (uid) json["uid"] = *uid;
  if (const auto login = pid > 0 ? login_of(pid) : std::nullopt) json["login_uid"] = *login;
  if (!process.empty()) json["process"] = process;
  return json;
}

// "2026"
std::string year_of(std::int64_t unix_ns) {
  return utc_text(unix_ns).substr(0, 4);
}

// The years that the folder has, oldest first.
std::vector<std::string> years_in(const std::string& folder) {
  std::vector<std::string> years;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (name.size() == 10 && name.ends_with(".jsonl") &&
        std::ranges::all_of(name.substr(0, 4), [](unsigned char c) { return std::isdigit(c) != 0; }))
      years.push_back(name.substr(0, 4));
  }
  std::ranges::sort(years);
  return years;
}

// The last line of a file, its end included; one that a power cut tore has none. Empty: the file has none.
std::expected<std::string, std::string> last_line(int file) {
  struct stat entry {};
  if (::fstat(file, &entry) != 0 || !S_ISREG(entry.st_mode)) return std::unexpected("it is no regular file");
  const auto size = static_cast<std::size_t>(entry.st_size);
  std::string tail(std::min(size, kLongestLine), '\0');
  std::size_t got = 0;
  while (got < tail.size()) {
    const ssize_t some =
        ::pread(file, tail.data() + got, tail.size() - got, static_cast<off_t>(size - tail.size() + got));
    if (some < 0 && errno == EINTR) continue;
    if (some <= 0) return std::unexpected(some < 0 ? error_text() : "it was cut while it was read");
    got += static_cast<std::size_t>(some);
  }
  if (tail.empty()) return tail;
  const std::size_t end_before = tail.size() < 2 ? std::string::npos : tail.rfind('\n', tail.size() - 2);
  if (end_before == std::string::npos)
    return size > tail.size() ? std::unexpected("its last line is too long")
                              : std::expected<std::string, std::string>(tail);
  return tail.substr(end_before + 1);
}

std::string year_path(const std::string& folder, const std::string& year) {
  return fmt::format("{}/{}.jsonl", folder, year);
}

// What root made there is the folder's owner's, who appends next. Nothing that has another name, too.
void give_to_owner(const std::string& folder, int made) {
  struct stat owner {
  }, file{};
  if (::geteuid() != 0 || ::stat(folder.c_str(), &owner) != 0 || ::fstat(made, &file) != 0) return;
  if (S_ISDIR(file.st_mode) || file.st_nlink == 1) (void)!::fchown(made, owner.st_uid, owner.st_gid);
}
void give_to_owner(const std::string& folder, const std::string& made) {
  const ipc::Descriptor opened(::open(made.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (opened.is_open()) give_to_owner(folder, opened.get());
}

// Not for ever: another process of the folder's group could hold it.
bool locked(int file, Duration patience) {
  const MonoTime until = monotonic_now() + patience;
  while (::flock(file, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK && errno != EINTR) return true;  // a file system without locks has none
    if (monotonic_now() >= until) return false;
    sleep_until(monotonic_now() + milliseconds(5));
  }
  return true;
}

bool are_alike(const OperatorWord& one, const OperatorWord& other) {
  return one.pid == other.pid && one.uid == other.uid && one.verb == other.verb && one.done == other.done &&
         std::string_view(one.answer) == other.answer;
}

void flatten(const config::Node& node, const std::string& key, std::map<std::string, std::string>& values) {
  const auto below = [&key](const std::string& name) { return key.empty() ? name : key + "." + name; };
  for (const config::Entry& entry : node.entries) flatten(entry.value, below(entry.key.text), values);
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    const config::Node* const name = node.items[i].find("name");
    flatten(node.items[i], below(name != nullptr ? name->text : std::to_string(i)), values);
  }
  if (node.kind == config::Node::Kind::scalar) values[key] = node.text;
}

std::map<std::string, std::string> values_of(std::string_view text) {
  config::Problems problems("robot file");
  const config::Node root = config::read_document(text, config::Tags::refuse, problems);
  std::map<std::string, std::string> values;
  if (problems.empty()) flatten(root, "", values);
  return values;
}

// Of the newest start of `robot` that the years hold: config_sha256. Empty: none.
std::string newest_start(const std::string& folder, const std::string& robot) {
  std::string hash;
  for (const std::string& year : years_in(folder)) {
    const auto text = read_file(year_path(folder, year));
    if (!text) continue;
    for (std::size_t at = 0; at < text->size();) {
      const std::size_t end = std::min(text->find('\n', at), text->size());
      const Json line = Json::parse(std::string_view(*text).substr(at, end - at), nullptr, false);
      at = end + 1;
      if (line.is_object() && line.value("what", Json()) == "start" && line.value("robot", Json()) == robot &&
          line.contains("config_sha256") && line["config_sha256"].is_string())
        hash = line["config_sha256"].get<std::string>();
    }
  }
  const bool is_hash = hash.size() == 64 && hash.find_first_not_of("0123456789abcdef") == std::string::npos;
  return is_hash ? hash : std::string();
}

}  // namespace

std::vector<ChangedKey> changed_keys(std::string_view before, std::string_view after) {
  const auto was = values_of(before), is = values_of(after);
  if (was.empty() || is.empty()) return {};
  std::map<std::string, ChangedKey> all;
  for (const auto& [key, value] : was) all[key].before = value;
  for (const auto& [key, value] : is) all[key].after = value;
  std::vector<ChangedKey> changed;
  for (auto& [key, one] : all) {
    one.key = key;
    if (one.before != one.after) changed.push_back(std::move(one));
  }
  return changed;
}

std::string intervention_folder(const std::string& record_directory) {
  std::error_code error;
  auto runs = std::filesystem::absolute(record_directory, error).lexically_normal();
  if (!runs.has_filename()) runs = runs.parent_path();  // "runs/"
  return (runs.parent_path() / "interventions").string();
}

bool InterventionLog::is_kept() const {
  std::error_code error;
  return !folder_.empty() && std::filesystem::is_directory(folder_, error);
}

void InterventionLog::note_start(const RunManifest& manifest, const config::RobotConfig& robot, std::int64_t unix_ns) {
  failure_.clear();
  if (!is_kept()) return;
  const std::string robots = folder_ + "/robots";
  const std::string before = newest_start(folder_, robot.robot);
  Json line{{"what", "start"},
            {"robot", robot.robot},
            {"run", manifest.run_id},
            {"who", who(manifest.executive_pid, std::nullopt, "takt-executive")},
            {"takt", version()},
            {"executive_sha256", manifest.executive_sha256},
            {"config_sha256", manifest.config_sha256},
            {"policy_sha256", manifest.policy_sha256},
            {"waivers", Json::array()}};
  for (const config::WatchdogWaiver& waiver : manifest.watchdog_waivers)
    line["waivers"].push_back({{"joint", waiver.joint}, {"reason", waiver.reason}});
  if (!before.empty() && before != manifest.config_sha256) {
    line["config_sha256_before"] = before;
    const auto old = read_file(robots + "/" + before + ".yaml");
    const auto changed = old ? changed_keys(*old, robot.resolved) : std::vector<ChangedKey>();
    line["changed"] = Json::array();
    for (std::size_t i = 0; i < std::min(changed.size(), kMostChangedKeys); ++i)
      line["changed"].push_back({{"key", changed[i].key}, {"before", changed[i].before}, {"after", changed[i].after}});
    if (changed.size() > kMostChangedKeys) line["more_changed"] = changed.size() - kMostChangedKeys;
  }
  std::error_code error;
  if (std::filesystem::create_directory(robots, error)) give_to_owner(folder_, robots);
  const std::string kept = robots + "/" + manifest.config_sha256 + ".yaml";
  std::string why;
  if (!std::filesystem::exists(kept, error)) {
    if (auto written = replace_file(kept, robot.resolved); !written) why = written.error();
    give_to_owner(folder_, kept);
  }
  append(std::move(line), unix_ns);
  if (failure_.empty()) failure_ = why;
}

void InterventionLog::note(const OperatorWord& word, const std::string& robot, std::int64_t unix_ns) {
  failure_.clear();
  if (!is_kept() || word.verb == OperatorVerb::mark || word.verb == OperatorVerb::status) return;
  if (newest_request_ && are_alike(word, *newest_request_)) {
    ++repeated_;
    return;
  }
  const bool is_written = append({{"what", name(word.verb)},
                                  {"robot", robot},
                                  {"who", who(word.pid, word.uid, std::string_view(word.program))},
                                  {"done", word.done != 0},
                                  {"answer", std::string_view(word.answer)}},
                                 unix_ns);
  if (is_written) newest_request_ = word;
}

void InterventionLog::note(const Deployment& deployment, std::int64_t unix_ns) {
  failure_.clear();
  if (!is_kept()) return;
  append({{"what", deployment.what},
          {"robot", deployment.robot},
          {"who", who(::getpid(), ::getuid(), "takt")},
          {"takt", version()},
          {"deployment_before", deployment.before},
          {"deployment", deployment.after},
          {"config_sha256", deployment.config_sha256},
          {"policy_sha256", deployment.policy},
          {"how", deployment.how}},
         unix_ns);
}

bool InterventionLog::append(Json line, std::int64_t unix_ns) {
  newest_request_.reset();
  budget_.refill(monotonic_now());
  if (!budget_.take()) {
    ++left_out_;
    return false;
  }
  // A clock that was set back opens no earlier year: the lines stay in the order in which they came.
  std::vector<std::string> years = years_in(folder_);
  const std::string year = years.empty() ? year_of(unix_ns) : std::max(year_of(unix_ns), years.back());
  const std::string path = year_path(folder_, year);
  const auto failed = [&](const std::string& why) {
    failure_ = fmt::format("{}: {}", path, why);
    return false;
  };
  // The folder's lock holds for all years.
  const ipc::Descriptor folder(::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder.is_open()) return failed(error_text());
  if (!locked(folder.get(), kLockPatience)) return failed("another process holds its lock");
  const ipc::Descriptor file(
      ::open(path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0640));
  if (!file.is_open()) return failed(error_text());
  auto before = last_line(file.get());
  if (!before) return failed(before.error());
  const off_t size = ::lseek(file.get(), 0, SEEK_END);
  std::string text;
  if (before->empty()) {
    give_to_owner(folder_, file.get());
    // A year begins: the chain goes on from the newest before it, and the oldest goes. By their number, not by the
    // clock, which a wrong one would empty the log by.
    std::erase(years, year);
    if (!years.empty()) {
      const ipc::Descriptor earlier(
          ::open(year_path(folder_, years.back()).c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
      if (auto last = last_line(earlier.get()); last) before = std::move(last);
    }
    for (std::size_t i = 0; i + kYearsKept < years.size(); ++i) {
      std::error_code ignored;
      std::filesystem::remove(year_path(folder_, years[i]), ignored);
    }
  } else if (before->back() != '\n') {
    *before += text = "\n";  // what a power cut tore ends here
  }
  Json whole{{"at", utc_text(unix_ns)}};
  whole.update(line);
  if (repeated_ > 0) whole["repeated"] = repeated_;
  if (left_out_ > 0) whole["left_out"] = left_out_;
  whole["before"] = before->empty() ? "" : config::sha256_hex(*before);
  text += whole.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  errno = 0;
  if (::write(file.get(), text.data(), text.size()) != static_cast<ssize_t>(text.size()) || ::fsync(file.get()) != 0) {
    failed(errno != 0 ? error_text() : "the disk is full");
    (void)!::ftruncate(file.get(), size);  // no half of a line
    return false;
  }
  repeated_ = left_out_ = 0;
  return true;
}

}  // namespace takt::monitor
