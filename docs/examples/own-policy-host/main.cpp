// A policy host with an engine of its own, which answers zeros. With `offset: home` in the robot file that is the home
// pose; put your own inference in the place of HomePose.
#include <algorithm>
#include <expected>
#include <memory>
#include <string>

#include "policy_host/program.hpp"

namespace {

class HomePose : public takt::policy_host::Policy {
 public:
  explicit HomePose(const takt::config::RobotConfig& robot)
      : input_size_(takt::config::observation_width(robot)),
        output_size_(robot.policy->steps * takt::config::outputs_per_step(robot)) {}

  [[nodiscard]] std::size_t input_size() const override { return input_size_; }
  [[nodiscard]] std::size_t output_size() const override { return output_size_; }
  void infer(std::span<const float> /*input*/, std::span<float> output) override { std::ranges::fill(output, 0.0F); }
  void reset() override {}  // nothing is remembered

 private:
  std::size_t input_size_, output_size_;
};

std::expected<std::unique_ptr<takt::policy_host::Policy>, std::string> load(const takt::config::RobotConfig& robot) {
  if (robot.policy->action.offset != takt::config::OffsetKind::home)
    return std::unexpected(robot.file + ": zeros are the home pose only with `offset: home`; set it in policy.action");
  return std::make_unique<HomePose>(robot);
}

}  // namespace

int main(int argc, char** argv) {
  return takt::policy_host::run_policy_host(argc, argv, load);
}
