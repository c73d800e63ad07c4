#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# make_past_run.sh COMMIT FOLDER: what a past commit recorded. Its own recorder is built in a worktree beside FOLDER, and records the virtual robot, whose policy
# freezes after 0.3 s, for 1,200 ticks; FOLDER gets what tests/releases keeps of it. Takes a quarter of an hour of one core.
set -eu
commit=$1 folder=$(realpath -m "$2")
tree=$folder.tree
git worktree add --force --detach "$tree" "$commit"
cd "$tree"
sed -i "s/kDemoTicks = 4'000/kDemoTicks = 1'200/" tests/monitor/record/recorded_demo.hpp
sed -i "s/(tick >= 1'500 \&\& tick < 1'900) || tick >= 3'000/tick >= 300/" tests/monitor/record/recorded_demo.cpp
# bbb22ff3 was built as unity files only.
grep -q fmt/format.h monitor/judge/run_metrics_json.cpp || sed -i '0,/#include </s//#include <fmt\/format.h>\n#include </' monitor/judge/run_metrics_json.cpp
cat >tests/monitor/record/make_recorded_demo.cpp <<'SOURCE'
#include "tests/monitor/record/recorded_demo.hpp"
int main(int, char** words) { (void)takt::monitor::record_demo(words[1]); }
SOURCE
cmake --preset release -DTAKT_BUILD_TESTS=ON
cmake --build build/release --target make_recorded_demo
build/release/bin/make_recorded_demo "$folder.run"
mkdir -p "$folder"
(cd "$folder.run" && cp config.yaml manifest.json ticks.mcap transitions.jsonl "$folder/")
git worktree remove --force "$tree"
