// SPDX-License-Identifier: Apache-2.0
// Goal: leases follow processes. Method: a real child takes the policy lease and is killed; a real server is killed and
// its socket taken over.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <stdexcept>

#include "tests/executive/ipc/rendezvous_server_thread.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::ipc {
namespace {

constexpr std::chrono::milliseconds kTimeout{5000};

Hello policy_hello(const char* program) {
  Hello hello;
  std::strncpy(hello.program, program, sizeof hello.program - 1);
  return hello;
}

RendezvousServer::Handlers admit_all() {
  return {
      .admit = [](const Peer&) { return Admission{}; }, .acknowledged = {}, .recorded = {}, .left = {}, .request = {}};
}

// A child that does `prepare`, tells us the outcome and sleeps until killed.
class Child {
 public:
  template <class Prepare>
  explicit Child(Prepare prepare) {
    int ends[2];
    if (pipe(ends) != 0) throw std::runtime_error("pipe failed");
    pid_ = fork();
    if (pid_ == 0) {
      alarm(60);
      const auto held = prepare();
      const char outcome = held.has_value() ? 'y' : 'n';
      [[maybe_unused]] const auto written = write(ends[1], &outcome, 1);
      for (;;) pause();
    }
    close(ends[1]);
    char outcome = 'n';
    is_ready_ = read(ends[0], &outcome, 1) == 1 && outcome == 'y';
    close(ends[0]);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() { end(SIGKILL); }
  void end(int signal) {
    if (pid_ <= 0) return;
    kill(pid_, signal);
    waitpid(pid_, nullptr, 0);
    pid_ = 0;
  }
  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] bool is_ready() const { return is_ready_; }

 private:
  pid_t pid_ = 0;
  bool is_ready_ = false;
};

TEST(RendezvousProcess, LeaseNamesTheChildAndIsFreeOnceItIsKilled) {
  const test::TemporaryDirectory directory;
  const std::string path = directory.path("executive.sock");
  auto listening = RendezvousServer::listen(path, geteuid(), admit_all());
  ASSERT_TRUE(listening);
  for (int round = 0; round < 5; ++round) {
    std::jthread serving([&](const std::stop_token& stop) {
      while (!stop.stop_requested()) listening->serve(std::chrono::milliseconds(5));
    });
    Child holder([&] { return attach(path, policy_hello("holder"), kTimeout); });
    ASSERT_TRUE(holder.is_ready());
    const auto refused = attach(path, policy_hello("second"), kTimeout);
    ASSERT_FALSE(refused);
    const std::string expected = "policy is leased by pid " + std::to_string(holder.pid()) + " (holder)";
    EXPECT_NE(refused.error().find(expected), std::string::npos) << refused.error();
    holder.end(SIGKILL);
    const auto lease = attach(path, policy_hello("second"), kTimeout);
    EXPECT_TRUE(lease) << lease.error();
  }
}

TEST(RendezvousProcess, KilledServersSocketIsTakenOver) {
  const test::TemporaryDirectory directory;
  const std::string path = directory.path("executive.sock");
  Child server([&] { return RendezvousServer::listen(path, geteuid(), admit_all()); });
  ASSERT_TRUE(server.is_ready());
  EXPECT_FALSE(RendezvousServer::listen(path, geteuid(), admit_all())) << "it lives";
  server.end(SIGKILL);
  ASSERT_TRUE(std::filesystem::exists(path));
  EXPECT_TRUE(RendezvousServer::listen(path, geteuid(), admit_all()));
}

}  // namespace
}  // namespace takt::ipc
