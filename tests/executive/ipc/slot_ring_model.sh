#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Goal: every interleaving of the slot protocol's model is safe, and the model can tell. Method: spin explores them all; the
# wrong variants must be refuted. Exit code 77 (skipped) where spin is not installed.
# Usage: slot_ring_model.sh MODEL
set -eu
command -v spin >/dev/null || {
  echo "SKIPPED: spin is not installed, the slot protocol's model was NOT checked"
  exit 77
}
model=$(realpath "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

errors() {
  spin -a "$@" "$model"
  cc -O1 -w -DSAFETY -o pan pan.c
  ./pan -m100000 | sed -n 's/.*errors: \([0-9]*\).*/\1/p'
}

[ "$(errors)" = 0 ] || {
  echo "the protocol as shipped violates its model"
  exit 1
}
for wrong in NO_SECOND_LOOK NO_ODD_MARK ANY_EVEN_VERSION; do
  [ "$(errors "-D$wrong")" != 0 ] || {
    echo "$wrong is not refuted: the model has no teeth"
    exit 1
  }
done
echo "model holds; three wrong variants refuted"
