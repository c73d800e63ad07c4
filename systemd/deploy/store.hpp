// SPDX-License-Identifier: Apache-2.0
// Where a machine keeps the robots it was told to run, one folder each, and which of them it runs.
//
//   STORE/robot                          link to the folder in use; units read STORE/robot/robot.yaml
//   STORE/deployments/NAME/robot.yaml    the robot file in canonical form, its policy beside it
//   STORE/deployments/NAME/original.yaml as it was written
//   STORE/deployments/NAME/previous      link to the folder that was in use before
//   STORE/deployments/NAME/simulated     present: takt-plant.service plays the robot
//   STORE/deployments/NAME/tried         SHA-256 of its files as they were tried, as `sha256sum -c` reads them
//   STORE/deployments/NAME/proven        present: it passed its probation
//
// One rename of one link changes what is in use. A folder gets its name by one rename too, after everything in it
// reached the disk: killed at any instant, the store names the old robot or the new one, whole. What an interrupted
// deployment left unnamed (.staging-*) is removed by the next. Thread rule: one process at a time; a lock file says so.
#pragma once

#include <expected>
#include <functional>
#include <optional>
#include <string>

#include "config/robot_config.hpp"
#include "executive/ipc/descriptor.hpp"

namespace takt::deploy {

struct Newcomer {
  const config::RobotConfig& robot;  // loaded, its policy readable
  std::string name;                  // of the folder: at most 100 of a-z A-Z 0-9 _ - .
  std::string runs_folder;           // record.directory of the copy, whatever the file says
  bool simulated = false;
};

// Asked about the copy, by the path of its robot file, before it gets its name. The error: why it does not get one.
using TryOut = std::function<std::expected<void, std::string>(const std::string& robot_file)>;

class Store {
 public:
  // Every error is one sentence. Refused while another process holds the store. `on_step`: called after each change on
  // disk, for tests.
  static std::expected<Store, std::string> open(const std::string& folder, std::function<void()> on_step = {});

  // Name of the folder in use; empty: none.
  [[nodiscard]] std::string current() const;
  // What that one replaced; empty: nothing, or it is gone.
  [[nodiscard]] std::string previous() const;
  [[nodiscard]] bool is_proven(const std::string& name) const;
  // Of one deployment. Refused: what is no name, and what was never deployed.
  [[nodiscard]] std::expected<std::string, std::string> robot_file(const std::string& name) const;

  // Copies robot file and policy into a folder of their own, which only this user enters until the copy is tried: what
  // changes in the files that it came from changes nothing in what is tried, kept and used. Not in use yet.
  std::expected<void, std::string> add(const Newcomer& newcomer, const TryOut& try_out = {});
  // The error: which of its files is another than was tried. A folder that says nothing of it has none.
  [[nodiscard]] std::expected<void, std::string> is_as_tried(const std::string& name) const;
  // From now on `name` is in use.
  std::expected<void, std::string> use(const std::string& name);
  std::expected<void, std::string> mark_proven(const std::string& name);

 private:
  Store(std::string folder, ipc::Descriptor lock, std::function<void()> on_step)
      : folder_(std::move(folder)), lock_(std::move(lock)), on_step_(std::move(on_step)) {}
  [[nodiscard]] std::string deployments() const { return folder_ + "/deployments"; }
  std::expected<void, std::string> fill(const std::string& staging, const Newcomer& newcomer);
  std::expected<void, std::string> try_copy(const std::string& staging, const TryOut& try_out);
  std::expected<void, std::string> link(const std::string& target, const std::string& path);
  void stepped() const {
    if (on_step_) on_step_();
  }

  std::string folder_;
  ipc::Descriptor lock_;
  std::function<void()> on_step_;
};

}  // namespace takt::deploy
