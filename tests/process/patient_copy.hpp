// SPDX-License-Identifier: Apache-2.0
// A robot for a machine that stalls now and then: what fails in a test is then what the test made fail.
#pragma once

#include <string>
#include <vector>

#include "config/load.hpp"

namespace takt::test {

// Copies a robot file into `directory`, with a joint and a host that may be silent for 200 ms and 500 ms before the
// executive and the simulated drives act on it, and with `changes`. Returns the copy's path; throws what is wrong with
// the file.
std::string patient_copy(const std::string& robot_file, const std::string& directory,
                         const std::vector<config::Override>& changes = {});

}  // namespace takt::test
