// SPDX-License-Identifier: Apache-2.0
#include "policy_host/boundary.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <glob.h>
#include <linux/capability.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>

#include "executive/ipc/policy_users.hpp"
#include "policy_host/seccomp_program.hpp"

namespace takt::policy_host {
namespace {

// landlock(7); the distribution's headers are older than the kernels that Takt runs on.
struct LandlockRuleset {
  std::uint64_t files = 0, network = 0, scoped = 0;
};
struct LandlockFolder {
  std::uint64_t allowed = 0;
  int folder = -1;
} __attribute__((packed));
constexpr std::uint64_t kWriteFile = 1U << 1U, kTruncate = 1U << 14U, kRefer = 1U << 13U;
constexpr std::uint64_t kChangeFolder = 0x1FF0;  // remove and make: directories, files, sockets, pipes, devices, links
constexpr std::uint64_t kScopeAbstractSockets = 1, kScopeSignals = 2;
constexpr int kPathBeneath = 1;
constexpr std::uint32_t kVersion = 1;
constexpr unsigned kFirstOfOthers = STDERR_FILENO + 1;
constexpr int kLeastForRefer = 2, kLeastForTruncate = 3, kLeastForScopes = 6;

long landlock_version() {
  return syscall(SYS_landlock_create_ruleset, nullptr, 0, kVersion);
}

bool write_text(const char* path, const std::string& text) {
  const int file = open(path, O_WRONLY | O_CLOEXEC);
  if (file < 0) return false;
  const bool written = write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  close(file);
  return written;
}

std::vector<std::string> lines_of(const char* path) {
  std::vector<std::string> lines;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

// Each id of this namespace as itself.
std::string same_ids(const char* map) {
  std::string text;
  for (const std::string& line : lines_of(map)) {
    unsigned inside = 0, outside = 0, count = 0;
    std::istringstream numbers(line);
    if (numbers >> inside >> outside >> count) text += fmt::format("{0} {0} {1}\n", inside, count);
  }
  return text;
}

// Root's policy reads what root reads: all ids are mapped, which takes a process outside. The function writes them;
// without them it is root alone.
std::function<void()> all_ids_from_outside() {
  std::array<int, 2> go{-1, -1};
  if (geteuid() != 0 || pipe2(go.data(), O_CLOEXEC) != 0) return [] {};
  const std::string users = same_ids("/proc/self/uid_map"), groups = same_ids("/proc/self/gid_map");
  const std::string process = fmt::format("/proc/{}/", getpid());
  const pid_t helper = fork();
  if (helper == 0) {
    char end = 0;
    close(go[1]);
    (void)(read(go[0], &end, 1) == 0 && write_text((process + "uid_map").c_str(), users) &&
           write_text((process + "gid_map").c_str(), groups));
    _exit(0);
  }
  close(go[0]);
  return [helper, tell = go[1]] {
    close(tell);
    if (helper > 0) waitpid(helper, nullptr, 0);
  };
}

// With the rights of no administrator, in its own namespace too: of root's, opening files is left.
constexpr std::array kOpensFiles{CAP_DAC_READ_SEARCH, CAP_DAC_OVERRIDE};

void drop_capabilities() {
  for (int capability = 0; prctl(PR_CAPBSET_READ, capability, 0, 0, 0) >= 0; ++capability)
    if (std::ranges::find(kOpensFiles, capability) == kOpensFiles.end()) prctl(PR_CAPBSET_DROP, capability, 0, 0, 0);
}

// One that no other process has; the files that root opens it still opens, as far as the other layers permit.
bool become_own_user() {
  const uid_t user = ipc::kFirstOwnUser + static_cast<uid_t>(getpid());
  prctl(PR_SET_KEEPCAPS, 1, 0, 0, 0);
  if (setresuid(user, user, user) != 0) return false;
  std::uint32_t kept = 0;
  for (const int capability : kOpensFiles) kept |= 1U << static_cast<unsigned>(capability);
  __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  const std::array<__user_cap_data_struct, 2> data{{{kept, kept, kept}, {0, 0, 0}}};
  bool done = syscall(SYS_capset, &header, data.data()) == 0;
  for (const int capability : kOpensFiles) done &= prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_RAISE, capability, 0, 0) == 0;
  return done;
}

// False: the kernel gives none, or not `others` in it.
bool enter_user_namespace(unsigned others) {
  const std::string user = fmt::format("{0} {0} 1", geteuid()), group = fmt::format("{0} {0} 1", getegid());
  const std::function<void()> map_all = all_ids_from_outside();
  const bool entered = unshare(static_cast<int>(CLONE_NEWUSER | others)) == 0;
  const int error = errno;
  if (entered) (void)write_text("/proc/self/setgroups", "deny");
  map_all();
  errno = error;
  if (!entered) return false;
  (void)write_text("/proc/self/uid_map", user);  // a map is written once: not over all of them
  (void)write_text("/proc/self/gid_map", group);
  return true;
}

// Paths of the sockets that programs listen at, but for those that a policy has to do with.
std::vector<std::string> foreign_sockets(const std::string& runtime_directory) {
  std::vector<std::string> found;
  for (const std::string& line : lines_of("/proc/net/unix")) {
    const std::size_t path_at = line.find(" /");
    if (path_at == std::string::npos) continue;
    const std::filesystem::path path = line.substr(path_at + 1);
    const std::string name = path.filename();
    std::error_code error;
    const bool ours = std::filesystem::equivalent(path.parent_path(), runtime_directory, error);
    if ((ours && !name.starts_with("can-")) || name.starts_with("lttng-ust-sock")) continue;
    found.push_back(path);
  }
  return found;
}

// Services do what their user asks, outside any boundary: the session's bus, tmux, a container engine. One that it
// cannot get at needs no hiding.
bool hide_sockets(const std::vector<std::string>& sockets) {
  bool all = true;
  for (const std::string& socket : sockets) {
    std::error_code error;
    if (std::filesystem::is_socket(socket, error))
      all &= mount("/dev/null", socket.c_str(), nullptr, MS_BIND, nullptr) == 0;
  }
  return all;
}

// For kernels without Landlock, whose mounts are all read-only then, but for the granted folders.
bool make_files_read_only(const std::vector<std::string>& writable) {
  constexpr long kMountSetattr = 442;  // the distribution's headers are older
  constexpr unsigned kRecursive = 0x8000;
  constexpr std::uint64_t kReadOnly = 1;
  struct Change {
    std::uint64_t set = 0, clear = 0, propagation = 0, users = 0;
  };
  const auto change = [](const std::string& path, const Change& what) {
    return syscall(kMountSetattr, AT_FDCWD, path.c_str(), kRecursive, &what, sizeof what) == 0;
  };
  std::error_code error;
  const std::filesystem::path here = std::filesystem::current_path(error);
  bool done = true;
  for (const std::string& folder : writable)
    done &= mount(folder.c_str(), folder.c_str(), nullptr, MS_BIND | MS_REC, nullptr) == 0;
  done &= change("/", {.set = kReadOnly});
  for (const std::string& folder : writable) done &= change(folder, {.clear = kReadOnly});
  return done && chdir(here.c_str()) == 0;  // which may lie in such a folder
}

constexpr const char* kPermitNamespaces =
    "user.max_user_namespaces, kernel.unprivileged_userns_clone, kernel.apparmor_restrict_unprivileged_userns";

enum class Files : std::uint8_t { as_before, read_only };

Files leave_namespaces(const Grants& grants, std::vector<std::string>& gaps) {
  const std::vector<std::string> sockets = foreign_sockets(grants.runtime_directory);  // of this network's
  const std::string reach =
      grants.network ? "reach this user's services" : "reach the network and this user's services";
  const bool is_root = geteuid() == 0;
  if (enter_user_namespace(CLONE_NEWIPC | CLONE_NEWNS | (grants.network ? 0 : CLONE_NEWNET))) {
    if (!hide_sockets(sockets))
      gaps.emplace_back("it may reach this user's services: this machine permits no mounts in a user namespace");
    const bool read_only = landlock_version() <= 0 && make_files_read_only(grants.writable);
    drop_capabilities();
    if (is_root && !become_own_user()) {
      prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0);
      gaps.emplace_back(
          fmt::format("it shares its user with other policies: no user from {} on is mapped here (see "
                      "/proc/self/uid_map)",
                      ipc::kFirstOwnUser));
    }
    return read_only ? Files::read_only : Files::as_before;
  }
  const std::string why = std::strerror(errno);
  const bool is_known = enter_user_namespace(0);  // where its owner may have one, and nothing in it
  gaps.emplace_back(fmt::format("it may {}{}: this machine permits no {}namespaces ({}; see {})",
                                is_known ? "" : "be an operator and ", reach, is_known ? "network and mount " : "user ",
                                why, kPermitNamespaces));
  return Files::as_before;
}

std::uint64_t rights_of(long version) {
  std::uint64_t rights = kWriteFile | kChangeFolder;
  if (version >= kLeastForRefer) rights |= kRefer;
  if (version >= kLeastForTruncate) rights |= kTruncate;
  return rights;
}

// What every program writes to: itself, sinks, accelerators, and what tracing wakes it by.
std::vector<std::string> devices() {
  std::vector<std::string> found;
  for (const char* const pattern :
       {"/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom", "/dev/nvidia*", "/dev/nvhost*",
        "/dev/nvgpu/*/*", "/dev/nvmap", "/dev/dri/*", "/dev/kfd", "/dev/accel/*", "/dev/shm/lttng-ust-wait*"}) {
    glob_t matches{};
    if (glob(pattern, GLOB_NOSORT, nullptr, &matches) == 0)
      for (std::size_t i = 0; i < matches.gl_pathc; ++i) found.emplace_back(matches.gl_pathv[i]);
    globfree(&matches);
  }
  return found;
}

bool allow(int ruleset, const std::string& path, std::uint64_t rights) {
  LandlockFolder rule{.allowed = rights, .folder = open(path.c_str(), O_PATH | O_CLOEXEC)};
  if (rule.folder < 0) return false;
  const bool added = syscall(SYS_landlock_add_rule, ruleset, kPathBeneath, &rule, 0) == 0;
  close(rule.folder);
  return added;
}

void fence_files(const Grants& grants, long version, Files files, std::vector<std::string>& gaps) {
  constexpr const char* kNone = "it may change files: this kernel has no Landlock (boot with lsm=landlock,...)";
  const std::uint64_t rights = rights_of(version);
  LandlockRuleset rules{.files = rights};
  if (version >= kLeastForScopes) rules.scoped = kScopeSignals | kScopeAbstractSockets;
  const std::size_t size = version >= kLeastForScopes ? sizeof rules : sizeof rules.files;
  const int ruleset = version <= 0 ? -1 : static_cast<int>(syscall(SYS_landlock_create_ruleset, &rules, size, 0));
  if (ruleset < 0) {
    if (files == Files::as_before) gaps.emplace_back(kNone);
    return;
  }
  const std::uint64_t of_a_file = rights & (kWriteFile | kTruncate);
  for (const std::string& device : devices()) (void)allow(ruleset, device, of_a_file);
  (void)allow(ruleset, fmt::format("/proc/{}", getpid()), of_a_file);
  for (const std::string& folder : grants.writable)
    if (!allow(ruleset, folder, rights))
      gaps.emplace_back(fmt::format("it may not write {}: {}", folder, std::strerror(errno)));
  if (syscall(SYS_landlock_restrict_self, ruleset, 0) != 0) gaps.emplace_back(kNone);
  close(ruleset);
}

// No policy needs any of them.
constexpr std::array kForbidden{
    __NR_ptrace,
    __NR_process_vm_readv,
    __NR_process_vm_writev,
    __NR_process_madvise,
    __NR_process_mrelease,
    __NR_pidfd_getfd,
    __NR_kcmp,
    __NR_bpf,
    __NR_perf_event_open,
    __NR_userfaultfd,
    __NR_keyctl,
    __NR_add_key,
    __NR_request_key,
    __NR_mount,
    __NR_umount2,
    __NR_pivot_root,
    __NR_chroot,
    __NR_move_mount,
    __NR_open_tree,
    __NR_fsopen,
    __NR_fsconfig,
    __NR_fsmount,
    __NR_fspick,
    __NR_mount_setattr,
    __NR_setns,
    __NR_unshare,
    __NR_io_uring_setup,
    __NR_io_uring_enter,
    __NR_io_uring_register,
    __NR_kexec_load,
    __NR_kexec_file_load,
    __NR_init_module,
    __NR_finit_module,
    __NR_delete_module,
    __NR_reboot,
    __NR_swapon,
    __NR_swapoff,
    __NR_acct,
    __NR_syslog,
    __NR_settimeofday,
    __NR_clock_settime,
    __NR_adjtimex,
    __NR_clock_adjtime,
    __NR_sched_setattr,
    __NR_sched_setparam,
    __NR_move_pages,
    __NR_migrate_pages,
    __NR_ioprio_set,
    __NR_flock,
};
// They change a file's mode, owner, times or attributes, of which landlock(7) says nothing.
constexpr int kChangeModeAt = 452, kOpenAt2 = 437;  // fchmodat2 and openat2; the distribution's headers are older
constexpr std::array kForbiddenOnFiles{
    kChangeModeAt, __NR_fchmod,    __NR_fchmodat,  __NR_fchown,      __NR_fchownat,     __NR_utimensat,
    __NR_setxattr, __NR_lsetxattr, __NR_fsetxattr, __NR_removexattr, __NR_lremovexattr, __NR_fremovexattr,
};
#if defined(__x86_64__)
constexpr std::array kForbiddenOldForms{__NR_chmod, __NR_chown, __NR_lchown, __NR_utime, __NR_utimes, __NR_futimesat};
#else
constexpr std::array<int, 0> kForbiddenOldForms{};
#endif

// Calls judged by one of their arguments.
struct ByArgument {
  int call;
  std::uint32_t argument;
  std::vector<std::uint32_t> values;
};
constexpr std::uint32_t kNewNamespaces =
    CLONE_NEWUSER | CLONE_NEWNS | CLONE_NEWNET | CLONE_NEWIPC | CLONE_NEWPID | CLONE_NEWUTS | CLONE_NEWCGROUP;

// What they may be asked for: itself (0 too), and the families of sockets that carry no frames.
std::vector<ByArgument> allowed_only(bool scoped) {
  const auto itself = [](int call, std::uint32_t argument) {
    return ByArgument{call, argument, {0, static_cast<std::uint32_t>(getpid())}};
  };
  std::vector<ByArgument> rules{{__NR_socket, 0, {AF_UNIX, AF_INET, AF_INET6, AF_NETLINK}},
                                itself(__NR_prlimit64, 0),
                                itself(__NR_setpriority, 1),
                                itself(__NR_sched_setaffinity, 0)};
  if (scoped) return rules;
  for (const int call : {__NR_kill, __NR_tgkill, __NR_tkill, __NR_rt_sigqueueinfo, __NR_rt_tgsigqueueinfo})
    rules.push_back(itself(call, 0));
  return rules;
}
// What they may not: keys typed into a terminal, signals and leases by a descriptor, others' priorities.
std::vector<ByArgument> refused_only() {
  return {{__NR_ioctl, 1, {TIOCSTI, TIOCLINUX, FIOSETOWN, SIOCSPGRP}},
          {__NR_fcntl, 1, {F_SETLEASE, F_SETOWN, F_SETOWN_EX}},
          {__NR_setpriority, 0, {PRIO_USER}}};
}

constexpr sock_filter refuse_with(std::uint32_t error) {
  return statement(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | error);
}
constexpr sock_filter load_argument(std::uint32_t argument) {  // its low half; all of them are of 32 bits
  return statement(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offsetof(seccomp_data, args)) + 8 * argument);
}
constexpr sock_filter kRefuse = refuse_with(EPERM);
constexpr sock_filter kDoneWithoutACall = refuse_with(0);
constexpr sock_filter kAllow = statement(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
constexpr sock_filter kLoadCall = statement(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr));

class Filter {
 public:
  Filter() {
    add({statement(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, arch)),
         jump(BPF_JMP | BPF_JEQ | BPF_K, kArchitecture, 1, 0), kRefuse,  // calls of another architecture: all of them
         kLoadCall, jump(BPF_JMP | BPF_JSET | BPF_K, kX32Bit, 0, 1), kRefuse});
  }
  void forbid(int call, std::uint32_t error = EPERM) {
    add({jump(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, 1), refuse_with(error)});
  }
  // With any of these bits in its first argument.
  void forbid_bits(int call, std::uint32_t bits) {
    add({jump(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, 4), load_argument(0),
         jump(BPF_JMP | BPF_JSET | BPF_K, bits, 0, 1), kRefuse, kLoadCall});
  }
  // With `value` in these bits of that argument.
  void forbid_masked(int call, std::uint32_t argument, std::uint32_t bits, std::uint32_t value) {
    add({jump(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, 5), load_argument(argument),
         statement(BPF_ALU | BPF_AND | BPF_K, bits), jump(BPF_JMP | BPF_JEQ | BPF_K, value, 0, 1), kRefuse, kLoadCall});
  }
  void forbid(const ByArgument& rule) {
    judge(rule, kRefuse);
    add({kLoadCall});
  }
  void allow_only(const ByArgument& rule, sock_filter verdict = kAllow) {
    judge(rule, verdict);
    add({kRefuse});
  }
  bool install() {
    program_.push_back(kAllow);
    const sock_fprog filter{.len = static_cast<std::uint16_t>(program_.size()), .filter = program_.data()};
    return syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, 0, &filter) == 0;
  }

 private:
  // `verdict` for the rule's values; one statement of the caller's follows, for all others.
  void judge(const ByArgument& rule, sock_filter verdict) {
    const auto length = static_cast<std::uint8_t>(1 + 2 * rule.values.size() + 1);
    add({jump(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(rule.call), 0, length),
         load_argument(rule.argument)});
    for (const std::uint32_t value : rule.values) add({jump(BPF_JMP | BPF_JEQ | BPF_K, value, 0, 1), verdict});
  }
  void add(std::initializer_list<sock_filter> more) { program_.insert(program_.end(), more); }
  std::vector<sock_filter> program_;
};

// Files are emptied by name, and by being opened, be it for reading.
void forbid_emptying(Filter& filter) {
  constexpr std::uint32_t kBits = O_TRUNC | O_ACCMODE, kEmpties = O_TRUNC | O_RDONLY;
  filter.forbid(__NR_truncate);
  filter.forbid(kOpenAt2, ENOSYS);  // its flags cannot be seen; openat() is asked then
  filter.forbid_masked(__NR_openat, 2, kBits, kEmpties);
#if defined(__x86_64__)
  filter.forbid_masked(__NR_open, 1, kBits, kEmpties);
#endif
}

// `landlock`: the version of which fence_files() made use.
bool fence_calls(long landlock) {
  const bool scoped = landlock >= kLeastForScopes;
  Filter filter;
  if (landlock < kLeastForTruncate) forbid_emptying(filter);
  for (const int call : kForbidden) filter.forbid(call);
  for (const int call : kForbiddenOnFiles) filter.forbid(call);
  for (const int call : kForbiddenOldForms) filter.forbid(call);
  if (!scoped) filter.forbid(__NR_pidfd_send_signal);
  filter.forbid(__NR_clone3, ENOSYS);  // its flags cannot be seen; every library falls back on clone
  filter.forbid_bits(__NR_clone, kNewNamespaces);
  for (const ByArgument& rule : refused_only()) filter.forbid(rule);
  for (const ByArgument& rule : allowed_only(scoped)) filter.allow_only(rule);
  // ZeroMQ ends its process where a thread may not ask for the class that it has; others' classes stay as they are.
  filter.allow_only({__NR_sched_setscheduler, 1, {SCHED_OTHER}}, kDoneWithoutACall);
  return filter.install();
}

void give_up_real_time() {
  constexpr rlimit none{0, 0};
  setrlimit(RLIMIT_RTPRIO, &none);
  setrlimit(RLIMIT_CORE, &none);
}

}  // namespace

std::expected<Grants, std::string> parse_grants(const std::vector<std::string>& texts) {
  constexpr std::string_view kWrite = "write=";
  Grants grants;
  for (const std::string& text : texts) {
    std::error_code error;
    if (text == "network") {
      grants.network = true;
    } else if (text == "everything") {
      grants.everything = true;
    } else if (text.starts_with(kWrite) && std::filesystem::is_directory(text.substr(kWrite.size()), error)) {
      grants.writable.push_back(std::filesystem::absolute(text.substr(kWrite.size())));
    } else if (text.starts_with(kWrite)) {
      return std::unexpected(text + ": no such folder; make it, or name another");
    } else {
      return std::unexpected(text + ": unknown; network, write=FOLDER or everything");
    }
  }
  return grants;
}

std::vector<std::string> grant_options(const Grants& grants) {
  std::vector<std::string> options;
  const auto add = [&options](const std::string& grant) { options.insert(options.end(), {"--policy-may", grant}); };
  if (grants.network) add("network");
  if (grants.everything) add("everything");
  for (const std::string& folder : grants.writable) add("write=" + folder);
  return options;
}

namespace {

std::vector<std::string> fence(const Grants& grants, long landlock_at_most, Files files) {
  std::vector<std::string> gaps;
  give_up_real_time();
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) gaps.emplace_back("it may gain rights by set-user-id programs");
  const long version = std::min(landlock_version(), landlock_at_most);
  fence_files(grants, version, files, gaps);
  if (!fence_calls(version))
    gaps.emplace_back(
        "it may trace, mount and change priorities: this kernel takes no seccomp filter "
        "(CONFIG_SECCOMP_FILTER)");
  return gaps;
}

}  // namespace

std::vector<std::string> fence_in(const Grants& grants, long landlock_at_most) {
  return fence(grants, landlock_at_most, Files::as_before);
}

std::vector<std::string> go_behind_boundary(const Grants& grants) {
  std::vector<std::string> gaps;
  if (grants.everything) return gaps;
  setsid();                                               // a terminal is nothing of its
  close_range(kFirstOfOthers, ~0U, CLOSE_RANGE_CLOEXEC);  // nor what this process has open
  const Files files = leave_namespaces(grants, gaps);
  for (std::string& gap : fence(grants, std::numeric_limits<long>::max(), files)) gaps.push_back(std::move(gap));
  return gaps;
}

}  // namespace takt::policy_host
