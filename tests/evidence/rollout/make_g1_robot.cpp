// Writes the robot file of g1_robot.hpp to standard output. Usage: make_g1_robot SHARED_DIR. Exit code 1: the published
// files are not there.
#include <cstdio>

#include "tests/evidence/rollout/g1_robot.hpp"

int main(int argc, char** argv) {
  const auto text = takt::panel::test::g1_robot_text(argc > 1 ? argv[1] : "../shared");
  if (!text) {
    std::fputs("make_g1_robot: no published model and policy there\n", stderr);
    return 1;
  }
  std::fputs(text->c_str(), stdout);
  return 0;
}
