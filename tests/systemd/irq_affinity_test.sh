#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Goal: irq-affinity moves what can be moved off the robot's core, keeps what is requested later off it, and does nothing when
# there is nothing to do. Method: the real script on planted /proc folders of 4, 32, 33 and 72 cores and of cores with gaps, with
# robot files that name a core, none, and the only one; a default mask that cannot be written.
# Usage: irq_affinity_test.sh SCRIPT TAKT CONFIG_DIR
set -euo pipefail
script=$1 takt=$2 config=$3
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
fail() { echo "FAILED: $*" >&2; exit 1; }

plant() { # CORES
  rm -rf "$folder/proc"
  for cpu in $(seq 0 $(($1 - 1))); do mkdir -p "$folder/proc"; printf 'processor\t: %s\nflags\t: x\n\n' "$cpu" >>"$folder/proc/cpuinfo"; done
  for irq in 4 120; do mkdir -p "$folder/proc/irq/$irq"; echo 0-3 >"$folder/proc/irq/$irq/smp_affinity_list"; done
  echo ffffffff >"$folder/proc/irq/default_smp_affinity"
  mkdir "$folder/proc/irq/0" && mkdir "$folder/proc/irq/0/smp_affinity_list" # cannot be written, like a timer's
}
run() { "$script" --proc "$folder/proc" --takt "$takt" --robot "$1" 2>&1; }
default_mask() { cat "$folder/proc/irq/default_smp_affinity"; }
list() { cat "$folder/proc/irq/$1/smp_affinity_list"; }

plant 4
said=$(run "$config/arm6.yaml") # control.cpu: 1
[ "$(list 4)" = 0,2,3 ] && [ "$(list 120)" = 0,2,3 ] || fail "went to $(list 4) and $(list 120)"
grep -q '2 interrupts moved, 1 stay' <<<"$said" || fail "said: $said"
[ "$(default_mask)" = 0000000d ] || fail "four cores: default mask $(default_mask)"
grep -q '0000000d in .*/default_smp_affinity' <<<"$said" || fail "the default mask is not told: $said"

# The kernel's own form (lib/bitmap.c, bitmap_parse): 32 cores to a group, the highest first. Expected values are written by hand.
expect_mask() { # CORES CORE MASK
  plant "$1"
  sed "s/cpu: 1 /cpu: $2 /" "$config/arm6.yaml" >"$folder/core.yaml"
  said=$(run "$folder/core.yaml") || fail "$1 cores, control core $2: $said"
  [ "$(default_mask)" = "$3" ] || fail "$1 cores, control core $2: default mask $(default_mask), not $3"
}
expect_mask 32 31 7fffffff
expect_mask 32 0 fffffffe
expect_mask 33 1 00000001,fffffffd
expect_mask 33 32 ffffffff
expect_mask 72 40 000000ff,fffffeff,ffffffff
expect_mask 72 64 000000fe,ffffffff,ffffffff

# Cores 0, 1, 33 and 64 are online, 33 is the control core: a group of zeros keeps its place.
plant 2
for cpu in 33 64; do printf 'processor\t: %s\n\n' "$cpu" >>"$folder/proc/cpuinfo"; done
sed 's/cpu: 1 /cpu: 33 /' "$config/arm6.yaml" >"$folder/core.yaml"
run "$folder/core.yaml" >/dev/null
[ "$(default_mask)" = 00000001,00000000,00000003 ] || fail "gaps: default mask $(default_mask)"

plant 4
rm "$folder/proc/irq/default_smp_affinity" && mkdir "$folder/proc/irq/default_smp_affinity"
code=0; said=$(run "$config/arm6.yaml") || code=$?
[ "$code" = 1 ] && grep -q 'requested later may come to core 1' <<<"$said" || fail "default mask refused: exit code $code: $said"
[ "$(list 4)" = 0,2,3 ] || fail "default mask refused: the others stayed: $(list 4)"

plant 4
sed 's/cpu: 1 /cpu: none /' "$config/arm6.yaml" >"$folder/free.yaml"
said=$(run "$folder/free.yaml") || fail "no core named is not an error: $said"
[ "$(list 4)" = 0-3 ] && [ "$(default_mask)" = ffffffff ] || fail "moved although no core is named"

plant 1
sed 's/cpu: 1 /cpu: 0 /' "$config/arm6.yaml" >"$folder/only.yaml"
code=0; run "$folder/only.yaml" >/dev/null || code=$?
[ "$code" = 1 ] && [ "$(default_mask)" = ffffffff ] || fail "the only core: exit code $code, default mask $(default_mask)"
code=0; run "$folder/absent.yaml" >/dev/null || code=$?
[ "$code" = 65 ] || fail "no robot file: exit code $code"
code=0; "$script" --robot >/dev/null 2>&1 || code=$?
[ "$code" = 64 ] || fail "command line: exit code $code"
echo "interrupts go where they should"
