// SPDX-License-Identifier: Apache-2.0
#include "executive/ipc/policy_users.hpp"

#include <pwd.h>

#include <array>
#include <string>

#include "executive/ipc/unix_socket.hpp"

namespace takt::ipc {
namespace {

std::string name_of(uid_t uid) {
  std::array<char, 4096> room{};
  passwd entry{};
  passwd* found = nullptr;
  if (getpwuid_r(uid, &entry, room.data(), room.size(), &found) != 0 || found == nullptr) return {};
  return entry.pw_name;
}

std::optional<uid_t> find_user(const std::string& name) {
  const auto user = user_id(name);
  return user ? std::optional(*user) : std::nullopt;
}

}  // namespace

PolicyUsers PolicyUsers::around(std::optional<uid_t> policy) {
  const std::string name = policy ? name_of(*policy) : "";
  if (name.empty()) return {.policy = policy};
  return {.policy = policy, .fallback = find_user(name + "-fallback"), .bridge = find_user(name + "-bridge")};
}

bool PolicyUsers::include(uid_t uid) const {
  return uid == policy || uid == fallback || uid == bridge || is_own_user(uid);
}

bool PolicyUsers::may_be(uid_t uid, Role role) const {
  if (role == Role::sensor_reader) return true;
  if (is_own_user(uid)) return !policy || role == Role::candidate_policy;
  if (uid == fallback) return role == Role::fallback_policy;
  if (uid == bridge) return role == Role::policy;
  return role != Role::fallback_policy || !fallback;
}

}  // namespace takt::ipc
