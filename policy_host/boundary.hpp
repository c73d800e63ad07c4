// SPDX-License-Identifier: Apache-2.0
// The boundary around a policy: its program, or its library in a process of ours, is a stranger's. It holds for good,
// and for all that the process becomes and starts:
//
//   layer            what it takes                                               by
//   names            its own user namespace, by which the executive knows it     user_namespaces(7)
//                    (ipc/unix_socket.hpp): it may be a policy and no operator
//   network          every network, the loopback too, unless it is granted;      network_namespaces(7), seccomp(2)
//                    CAN always
//   services         sockets that other programs listen at, but for those in     mount_namespaces(7)
//                    its robot's runtime directory; of that the loopback buses
//   files            every change to a file outside the granted folders          landlock(7), seccomp(2); without
//                                                                                Landlock read-only mounts
//   user             of root's: what belongs to another policy's processes      setresuid(2)
//   other processes  their memory and tracing; signals to them                   landlock(7), seccomp(2)
//   system calls     tracing, mounts, keys, BPF, io_uring, namespaces, flock,    seccomp(2)
//                    scheduling classes; limits, priorities and processors of
//                    others
//   real time        RLIMIT_RTPRIO 0, no core files                              setrlimit(2)
//
// It reads what its user may read, and has what time and memory it is given.
#pragma once

#include <expected>
#include <limits>
#include <string>
#include <vector>

namespace takt::policy_host {

// What a policy is allowed on top.
struct Grants {
  bool network = false;
  std::vector<std::string> writable = {};  // folders
  bool everything = false;                 // there is no boundary
  std::string runtime_directory = {};      // of its robot: whose sockets it needs
};
// "network", "write=FOLDER", "everything".
std::expected<Grants, std::string> parse_grants(const std::vector<std::string>& texts);
// "--policy-may", "network", ...: what parse_grants() read.
std::vector<std::string> grant_options(const Grants& grants);

// One sentence for each layer that this kernel refuses; the others stand. Blocks for some 10 ms. For a process of one
// thread, which goes on as the policy, or becomes it.
std::vector<std::string> go_behind_boundary(const Grants& grants);

// The layers that need no namespaces, for a process under systemd, whose unit sees to the others. `landlock_at_most`:
// as a kernel has them whose Landlock is of this version; 0: without it.
std::vector<std::string> fence_in(const Grants& grants, long landlock_at_most = std::numeric_limits<long>::max());

}  // namespace takt::policy_host
