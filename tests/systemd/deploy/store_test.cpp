// SPDX-License-Identifier: Apache-2.0
// Goal: whatever interrupts a deployment, the store names a whole robot: the old one or the new one; and the next
// deployment works. Method: a process is killed after every single change on disk, in turn, while it deploys; the store
// is read afterwards as a unit would.
#include "systemd/deploy/store.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>

#include "config/load.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::deploy {
namespace {

namespace fs = std::filesystem;

class Deployments : public testing::Test {
 protected:
  Deployments() {
    fs::create_directory(root_.path("from"));
    fs::copy("config/arm6.yaml", root_.path("from/robot.yaml"));
    fs::copy("config/arm6_reach.onnx", root_.path("from/arm6_reach.onnx"));
    robot_ = config::load(root_.path("from/robot.yaml")).value();
  }
  [[nodiscard]] std::string store() const { return root_.path("store"); }
  [[nodiscard]] Newcomer newcomer(const std::string& name, bool simulated = false) const {
    return {robot_, name, "/runs", simulated};
  }
  // add() and use(), each expected to work.
  void deploy(const std::string& name) const {
    auto store = Store::open(this->store()).value();
    const auto added = store.add(newcomer(name));
    ASSERT_TRUE(added.has_value()) << added.error();
    ASSERT_TRUE(store.use(name).has_value());
  }
  // What a unit would start: the file behind the link, and its policy.
  [[nodiscard]] std::string problem_in_use() const {
    const auto robot = config::load(store() + "/robot/robot.yaml");
    if (!robot) return robot.error();
    const auto policy = config::policy_hash(robot->policy->file);
    if (!policy) return policy.error();
    return *policy == config::policy_hash("config/arm6_reach.onnx").value() ? "" : "the policy is another one";
  }
  // Deploys `name` in a process that is killed at the given change; false when it was through before.
  [[nodiscard]] bool killed_at(int step, const std::string& name) const {
    const pid_t child = fork();
    if (child == 0) {
      int left = step;
      auto store = Store::open(this->store(), [&left] {
        if (left-- == 0) kill(getpid(), SIGKILL);
      });
      const bool done = store && store->add(newcomer(name, true)) && store->use(name);
      _exit(done ? 0 : 1);
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status) || WEXITSTATUS(status) == 0);
    return WIFSIGNALED(status);
  }

  const test::TemporaryDirectory root_;
  config::RobotConfig robot_;
};

TEST_F(Deployments, ADeploymentStandsOnItsOwn) {
  deploy("one");
  fs::remove_all(root_.path("from"));
  EXPECT_EQ(problem_in_use(), "");
  const auto robot = config::load(store() + "/robot/robot.yaml").value();
  EXPECT_EQ(robot.record.directory, "/runs");
  EXPECT_EQ(robot.joints.size(), robot_.joints.size());
  EXPECT_TRUE(fs::exists(store() + "/robot/original.yaml"));
  EXPECT_FALSE(fs::exists(store() + "/robot/simulated"));
}

TEST_F(Deployments, WeightsBesideThePolicyComeAlong) {
  std::ofstream(root_.path("from/arm6_reach.onnx.data")) << "weights";
  const auto hash = config::policy_hash(root_.path("from/arm6_reach.onnx")).value();
  deploy("one");
  fs::remove_all(root_.path("from"));
  const auto robot = config::load(store() + "/robot/robot.yaml").value();
  EXPECT_EQ(config::policy_hash(robot.policy->file).value(), hash);
}

// Goal: what plays when the policy is gone is deployed like the policy. Method: both files have one name, in two
// folders.
TEST_F(Deployments, TheFallbacksPolicyComesAlongWithItsWeights) {
  const std::string fallback = root_.path("from/safe/arm6_reach.onnx");
  fs::create_directory(root_.path("from/safe"));
  fs::copy("config/arm6_visuomotor_reach.onnx", fallback);
  std::ofstream(fallback + ".data") << "weights";
  std::string edited = test::text_of(root_.path("from/robot.yaml"));
  edited.insert(edited.find("fallbacks:\n") + 11, "  stand: {kind: policy, file: safe/arm6_reach.onnx, for: 2 s}\n");
  const auto robot_file = config::parse(edited, root_.path("from/robot.yaml"));
  ASSERT_TRUE(robot_file.has_value()) << robot_file.error();
  robot_ = *robot_file;
  const auto hash = config::policy_hash(fallback).value();
  deploy("one");
  fs::remove_all(root_.path("from"));
  EXPECT_EQ(problem_in_use(), "");
  const auto robot = config::load(store() + "/robot/robot.yaml").value();
  EXPECT_EQ(config::policy_hash(robot.fallbacks.front().file).value(), hash);
}

// Goal: a robot that asks for a signed policy can be deployed. Method: key and signature are gone where they came from.
TEST_F(Deployments, TheKeyAndTheSignaturesComeAlong) {
  std::ofstream(root_.path("from/lab.pub")) << "key";
  std::ofstream(root_.path("from/arm6_reach.onnx.sig")) << "signature";
  const std::vector<config::Override> signed_by{{"policy.signed_by", "lab.pub"}};
  robot_ = config::with_overrides(robot_, signed_by).value();
  deploy("one");
  fs::remove_all(root_.path("from"));
  const auto robot = config::load(store() + "/robot/robot.yaml").value();
  EXPECT_TRUE(robot.policy->signed_by.starts_with(fs::canonical(store()).string())) << robot.policy->signed_by;
  EXPECT_EQ(test::text_of(robot.policy->signed_by), "key");
  EXPECT_EQ(test::text_of(robot.policy->file + ".sig"), "signature");
}

// The robot's processes are other users than who deploys.
TEST_F(Deployments, AreReadableWhateverTheUmask) {
  const mode_t before = umask(077);
  deploy("one");
  umask(before);
  using fs::perms;
  for (const char* folder : {"/store", "/store/deployments", "/store/deployments/one"})
    EXPECT_EQ(fs::status(root_.path() + folder).permissions() & perms::others_all,
              perms::others_read | perms::others_exec)
        << folder;
  for (const auto& file : fs::directory_iterator(store() + "/deployments/one"))
    EXPECT_EQ(file.status().permissions() & perms::others_all, perms::others_read) << file.path();
}

TEST_F(Deployments, BackIsWhereItCameFrom) {
  for (const char* name : {"one", "two", "three"}) deploy(name);
  auto store = Store::open(this->store()).value();
  EXPECT_EQ(store.current(), "three");
  for (const char* name : {"two", "one"}) {
    ASSERT_EQ(store.previous(), name);
    ASSERT_TRUE(store.use(name).has_value());
    EXPECT_EQ(store.current(), name);
    EXPECT_EQ(problem_in_use(), "");
  }
  EXPECT_EQ(store.previous(), "") << "nothing was before the first";
  EXPECT_FALSE(store.is_proven("one"));
  EXPECT_TRUE(store.mark_proven("one").has_value());
  EXPECT_TRUE(store.is_proven("one"));
}

TEST_F(Deployments, KilledAtAnyStepTheStoreNamesAWholeRobot) {
  deploy("old");
  int steps = 0;
  for (bool killed = true; killed; ++steps) {
    const std::string name = "new" + std::to_string(steps);
    killed = killed_at(steps, name);
    ASSERT_EQ(problem_in_use(), "") << "killed after change " << steps;
    auto store = Store::open(this->store());
    ASSERT_TRUE(store.has_value()) << "the lock went with its process";
    ASSERT_TRUE(store->current() == "old" || store->current() == name) << store->current();
    if (store->current() == name) {
      EXPECT_EQ(store->previous(), "old");
    }
    ASSERT_TRUE(store->use("old").has_value());
  }
  EXPECT_GE(steps, 9) << "every file, every link and every rename is a step";
  deploy("last");
  EXPECT_EQ(problem_in_use(), "");
  for (const auto& entry : fs::directory_iterator(store() + "/deployments"))
    EXPECT_FALSE(entry.path().filename().string().starts_with(".staging-")) << entry.path();
}

TEST_F(Deployments, WhatCannotBeIsRefusedInOneSentence) {
  deploy("one");
  auto store = Store::open(this->store()).value();
  EXPECT_FALSE(Store::open(this->store())) << "one at a time";
  EXPECT_NE(store.add(newcomer("one")).error().find("exists already"), std::string::npos);
  for (const std::string& name : {std::string(), std::string("../x"), std::string("../.."), std::string("a/b"),
                                  std::string(".hidden"), std::string("a b"), std::string(300, 'a')}) {
    EXPECT_NE(store.add(newcomer(name)).error().find("no name for a deployment"), std::string::npos) << name;
    EXPECT_NE(store.use(name).error().find("no name for a deployment"), std::string::npos) << name;
  }
  EXPECT_NE(store.use("absent").error().find("never deployed"), std::string::npos);
  EXPECT_EQ(store.current(), "one");
  fs::remove(root_.path("from/arm6_reach.onnx"));
  EXPECT_FALSE(store.add(newcomer("two")));
  EXPECT_FALSE(fs::exists(this->store() + "/deployments/two"));
}

// Goal: what was tried is what is used, whatever becomes of the files meanwhile. Method: two policies change places by
// renames all the while, each file whole at any time; the trial looks at the copy's hash.
// Threat: deploy-race
TEST_F(Deployments, WhatIsTriedIsWhatIsUsed) {
  constexpr int kTimes = 50;
  const std::string policy = root_.path("from/arm6_reach.onnx");
  std::atomic<bool> ends = false;
  std::thread changes([&] {
    for (bool other = true; !ends; other = !other) {
      fs::copy_file(other ? "config/arm6_visuomotor_reach.onnx" : "config/arm6_reach.onnx", policy + ".next",
                    fs::copy_options::overwrite_existing);
      fs::rename(policy + ".next", policy);
    }
  });
  auto store = Store::open(this->store()).value();
  int others = 0;
  for (int i = 0; i < kTimes; ++i) {
    std::uint64_t tried = 0;
    const std::string name = "n" + std::to_string(i);
    const auto added =
        store.add(newcomer(name), [&](const std::string& robot_file) -> std::expected<void, std::string> {
          tried = config::policy_hash(config::load(robot_file).value().policy->file).value();
          return {};
        });
    ASSERT_TRUE(added) << added.error();
    EXPECT_TRUE(store.is_as_tried(name)) << name;
    const auto used = config::load(store.robot_file(name).value()).value();
    EXPECT_EQ(config::policy_hash(used.policy->file).value(), tried) << name;
    if (tried != config::policy_hash("config/arm6_reach.onnx").value()) ++others;
  }
  ends = true;
  changes.join();
  EXPECT_GT(others, 0) << "nothing changed meanwhile";
  EXPECT_LT(others, kTimes) << "nothing changed meanwhile";
}

TEST_F(Deployments, WhatDoesNotStandTheTrialLeavesNothing) {
  auto store = Store::open(this->store()).value();
  std::string place;
  const auto refused = store.add(newcomer("one"), [&](const std::string& robot_file) {
    place = fs::path(robot_file).parent_path();
    EXPECT_EQ(fs::status(place).permissions() & fs::perms::all, fs::perms::owner_all) << "not tried yet";
    return std::expected<void, std::string>(std::unexpected("it falls"));
  });
  EXPECT_EQ(refused.error(), "it falls");
  EXPECT_FALSE(fs::exists(place));
  EXPECT_FALSE(fs::exists(this->store() + "/deployments/one"));
}

TEST_F(Deployments, AnEditAfterTheTrialIsNamed) {
  deploy("one");
  auto store = Store::open(this->store()).value();
  EXPECT_TRUE(store.is_as_tried("one"));
  std::ofstream(this->store() + "/deployments/one/arm6_reach.onnx", std::ios::app) << "more";
  EXPECT_NE(store.is_as_tried("one").error().find("arm6_reach.onnx is another than was tried"), std::string::npos);
}

// Goal: a deployment, which everybody may read, holds nothing that only who deploys may read. Method: what stands in a
// policy's place is a link, a pipe, a folder.
// Threat: deploy-links
TEST_F(Deployments, OnlyRegularFilesAreCopied) {
  auto store = Store::open(this->store()).value();
  const std::string weights = root_.path("from/arm6_reach.onnx.data");
  fs::create_symlink("/etc/shadow", weights);
  EXPECT_NE(store.add(newcomer("one")).error().find("arm6_reach.onnx.data is a link"), std::string::npos);
  fs::remove(weights);
  ASSERT_EQ(mkfifo(weights.c_str(), 0600), 0);
  EXPECT_NE(store.add(newcomer("one")).error().find("is not a regular file"), std::string::npos);
  fs::remove(weights);
  ASSERT_TRUE(store.add(newcomer("one")));
  EXPECT_TRUE(store.is_as_tried("one"));
}

// Goal: a user who may read the store cannot block a deployment or the way back. Method: what everybody may open is
// locked, as `flock -s` does it; the store's own lock is its owner's alone.
// Threat: user-locks-store
TEST_F(Deployments, ALockThatAnyUserMayHoldBlocksNothing) {
  deploy("one");
  for (const std::string& folder : {store(), store() + "/deployments", store() + "/deployments/one"}) {
    const ipc::Descriptor held(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    ASSERT_EQ(::flock(held.get(), LOCK_SH | LOCK_NB), 0);
    EXPECT_TRUE(Store::open(store())) << folder;
  }
  EXPECT_EQ(fs::status(store() + "/.lock").permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(Deployments, AFolderInTheLinksPlaceIsNotTouched) {
  fs::create_directories(store() + "/robot");
  std::ofstream(store() + "/robot/robot.yaml") << "mine";
  auto store = Store::open(this->store()).value();
  ASSERT_TRUE(store.add(newcomer("one")).has_value());
  EXPECT_NE(store.use("one").error().find("is not a link"), std::string::npos);
  EXPECT_TRUE(fs::exists(this->store() + "/robot/robot.yaml"));
}

}  // namespace
}  // namespace takt::deploy
