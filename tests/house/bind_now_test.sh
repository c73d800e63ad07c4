#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Goal: no program of ours resolves a symbol while it runs: the first call into a library costs a look-up, and inside
# the loop that is time nobody planned. Method: the dynamic section of every program asks the loader to bind at once.
#   bind_now_test.sh PROGRAM...
set -u
failed=0
for program in "$@"; do
  if ! readelf --dynamic "$program" | grep -Eq '\((BIND_NOW|FLAGS)\).*BIND_NOW|\(FLAGS_1\).*NOW'; then
    echo "$program is bound lazily: link it with -z now"
    failed=1
  fi
done
exit "$failed"
