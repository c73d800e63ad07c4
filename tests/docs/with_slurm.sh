#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# with_slurm.sh COMMAND...: runs COMMAND with a Slurm cluster of its own, one node with two processors on this machine's
# loopback, and ends the cluster with it. Debian's slurm-wlm and munge; no systemd, no cgroups, no account database; all
# files in a temporary folder, ports on which no process listens, the key of munge private to this user.
# Exit codes: COMMAND's; 77 Slurm is not installed (1 where TAKT_REQUIRE_SLURM is set); 1 the cluster did not come up.
set -euo pipefail
PATH=$PATH:/usr/sbin

for program in slurmctld slurmd sbatch munged parallel; do
  command -v "$program" >/dev/null && continue
  echo "SKIPPED: $program is not installed; ./dev test installs Debian's slurm-wlm, munge and parallel" >&2
  [ -z "${TAKT_REQUIRE_SLURM:-}" ] || exit 1
  exit 77
done

cluster=$(mktemp -d "${TMPDIR:-/tmp}/takt-slurm.XXXXXX")
chmod 755 "$cluster"
daemons=()
end_cluster() {
  trap - EXIT
  [ ${#daemons[@]} = 0 ] || { kill "${daemons[@]}" 2>/dev/null; wait "${daemons[@]}" 2>/dev/null; } || true
  rm -rf "$cluster"
}
trap end_cluster EXIT
trap 'exit 1' INT TERM HUP

read -r controller_port node_port < <(python3 - <<'PYTHON'
import socket
sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(2)]
print(*(one.getsockname()[1] for one in sockets))
PYTHON
)
mkdir -p "$cluster/state" "$cluster/spool"
cat >"$cluster/slurm.conf" <<CONF
ClusterName=takt
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
SlurmctldPort=$controller_port
SlurmdPort=$node_port
AuthType=auth/munge
AuthInfo=socket=$cluster/munge.socket
CredType=cred/munge
StateSaveLocation=$cluster/state
SlurmdSpoolDir=$cluster/spool
SlurmctldPidFile=$cluster/slurmctld.pid
SlurmdPidFile=$cluster/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
MailProg=/bin/true
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
ReturnToService=2
NodeName=$(hostname -s) NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
(umask 077 && head -c 128 /dev/urandom >"$cluster/munge.key")
export SLURM_CONF=$cluster/slurm.conf

# munged: --force, because a folder under /tmp and the superuser would not do for a real cluster.
munged --foreground --force --key-file="$cluster/munge.key" --socket="$cluster/munge.socket" \
  --pid-file="$cluster/munge.pid" --seed-file="$cluster/munge.seed" --log-file="$cluster/munged.log" >"$cluster/munged.out" 2>&1 &
daemons+=($!)
until_true() {
  local tries=0
  until "$@"; do
    [ $((tries += 1)) -le 300 ] || {
      echo "the cluster did not come up: $*" >&2
      tail -n 20 "$cluster"/*.log "$cluster"/*.out >&2
      exit 1
    }
    sleep 0.1
  done
}
is_idle() { [ "$(timeout 5 sinfo -h -o %T 2>/dev/null)" = idle ]; }
until_true test -S "$cluster/munge.socket"
slurmctld -D >"$cluster/slurmctld.log" 2>&1 &
daemons+=($!)
slurmd -D -N "$(hostname -s)" >"$cluster/slurmd.log" 2>&1 &
daemons+=($!)
until_true is_idle
"$@"
