#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The guest's root as a tar file: a real Debian 12 with its package database, maintainer scripts run.
# Usage: root.sh OUT.tar DEB_CACHE PACKAGE...     needs root and mmdebstrap
# Downloaded packages stay in DEB_CACHE, so that the next build needs the network for what changed only.
set -euo pipefail
out=$1 cache=$2
shift 2
mkdir -p "$cache"
cache=$(realpath "$cache")
include=$(IFS=,; echo "$*")
mmdebstrap --quiet --variant=apt --mode=root --include="$include" \
  --skip=download/empty --skip=essential/unlink --dpkgopt=force-unsafe-io \
  --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/locale/*' \
  --setup-hook="mkdir -p \"\$1/var/cache/apt/archives\"; cp -n '$cache'/*.deb \"\$1/var/cache/apt/archives/\" 2>/dev/null || true" \
  --customize-hook="cp -n \"\$1\"/var/cache/apt/archives/*.deb '$cache'; rm -f \"\$1\"/var/cache/apt/archives/*.deb" \
  --customize-hook='rm -rf "$1"/var/lib/apt/lists/*' \
  bookworm "$out"
