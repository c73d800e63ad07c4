#!/usr/bin/env bash
# Goal: irq-affinity moves what can be moved off the robot's core, and nothing when there is nothing to do. Method: the
# real script on a planted /proc of four cores, with robot files that name a core, none, and the only one.
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
  mkdir "$folder/proc/irq/0" && mkdir "$folder/proc/irq/0/smp_affinity_list" # cannot be written, like a timer's
}
run() { "$script" --proc "$folder/proc" --takt "$takt" --robot "$1" 2>&1; }
list() { cat "$folder/proc/irq/$1/smp_affinity_list"; }

plant 4
said=$(run "$config/arm6.yaml") # control.cpu: 1
[ "$(list 4)" = 0,2,3 ] && [ "$(list 120)" = 0,2,3 ] || fail "went to $(list 4) and $(list 120)"
grep -q '2 interrupts moved, 1 stay' <<<"$said" || fail "said: $said"

plant 4
sed 's/cpu: 1 /cpu: none /' "$config/arm6.yaml" >"$folder/free.yaml"
said=$(run "$folder/free.yaml") || fail "no core named is not an error: $said"
[ "$(list 4)" = 0-3 ] || fail "moved although no core is named"

plant 1
sed 's/cpu: 1 /cpu: 0 /' "$config/arm6.yaml" >"$folder/only.yaml"
code=0; run "$folder/only.yaml" >/dev/null || code=$?
[ "$code" = 1 ] || fail "the only core: exit code $code"
code=0; run "$folder/absent.yaml" >/dev/null || code=$?
[ "$code" = 65 ] || fail "no robot file: exit code $code"
code=0; "$script" --robot >/dev/null 2>&1 || code=$?
[ "$code" = 64 ] || fail "command line: exit code $code"
echo "interrupts go where they should"
