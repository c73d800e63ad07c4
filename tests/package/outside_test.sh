#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Goal: what takt-dev brings builds a program outside of this tree, by pkg-config and by CMake, wherever it is installed, and the
# library's name has the header's ABI. Method: the package's files in a folder of their own, and the example of a policy in C.
# Usage: outside_test.sh BUILD SOURCE
set -euo pipefail
build=$(realpath "$1") source=$(realpath "$2")
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
fail() { echo "FAILED: $*" >&2; exit 1; }

cmake --install "$build" --component dev --prefix "$root/usr" >/dev/null
libraries=$(dirname "$(find "$root/usr" -name libtakt-client.so)")
cp -P "$build"/lib/libtakt-client.so.* "$libraries"
cp -r "$source/docs/examples/c-policy" "$root/example"

cd "$root/example"
export PKG_CONFIG_PATH=$libraries/pkgconfig
cc -std=c11 sway.c $(pkg-config --cflags --libs takt) -lm -o by-pkg-config || fail "pkg-config's flags build nothing"
cmake -B by-cmake -DCMAKE_PREFIX_PATH="$root/usr" >cmake.log && cmake --build by-cmake >>cmake.log || { cat cmake.log; fail "TaktConfig.cmake builds nothing"; }
abi=$(sed -n 's/^#define TAKT_CLIENT_ABI \([0-9]*\)$/\1/p' "$root/usr/include/takt/client.h")
for program in by-pkg-config by-cmake/sway; do
  readelf -d "$program" | grep "NEEDED.*\[libtakt-client\.so\.$abi\]" >/dev/null || fail "$program does not need libtakt-client.so.$abi"
  LD_LIBRARY_PATH=$libraries ldd "$program" | grep "libtakt-client.so.$abi => $libraries" >/dev/null || fail "$program does not find its library"
done
version=$(pkg-config --modversion takt)
grep -q "project(takt VERSION $version " "$source/CMakeLists.txt" || fail "takt.pc says version $version"
echo "an example outside of the tree is built by pkg-config and by CMake"
