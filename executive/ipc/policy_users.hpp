// SPDX-License-Identifier: Apache-2.0
// The users that policies run as: one each, so that no policy can end, trace or replace another, nor take its seat.
// Under systemd they have names: that of --policy-user, and with `-fallback` and `-bridge` behind it where this machine
// has them. Behind the boundary of a root's command each has a number that no other process has. Thread rule: none.
#pragma once

#include <sys/types.h>

#include <optional>

#include "executive/contract/session.hpp"

namespace takt::ipc {

// Linux's pids are below 2^22. No distribution gives these numbers to anything (systemd, "Users, Groups, UIDs and
// GIDs").
inline constexpr uid_t kFirstOwnUser = 0x70000000, kOwnUsers = 1U << 22U;
constexpr bool is_own_user(uid_t uid) {
  return uid >= kFirstOwnUser && uid - kFirstOwnUser < kOwnUsers;
}

struct PolicyUsers {
  std::optional<uid_t> policy = {}, fallback = {}, bridge = {};

  static PolicyUsers around(std::optional<uid_t> policy);
  [[nodiscard]] bool include(uid_t uid) const;
  // Of one that they include. Where users have names, one without is a candidate's.
  [[nodiscard]] bool may_be(uid_t uid, Role role) const;
};

}  // namespace takt::ipc
