#!/usr/bin/env bash
# clang-tidy on every source that the given build folder compiles; unchanged files are remembered in .cache/lint.
set -euo pipefail
build=$1
cache=.cache/lint
mkdir -p "$cache"
settings=$(sha256sum .clang-tidy | cut -c1-16)

# A stamp per source: the source, every project header and the settings, hashed.
headers=$(git ls-files '*.hpp' | xargs cat | sha256sum | cut -c1-16)
check() {
  local source=$1 stamp
  stamp=$cache/$(cat "$source" | sha256sum | cut -c1-16)-$headers-$settings
  [ -e "$stamp" ] && return 0
  clang-tidy-19 --quiet -p "$build" --extra-arg=-Wno-unknown-warning-option --extra-arg=-Wno-deprecated-declarations "$source" 2>/dev/null && touch "$stamp"
}
export -f check
export build cache settings headers
git ls-files 'executive/*.cpp' 'drivers/*.cpp' 'policy_host/*.cpp' 'monitor/*.cpp' 'config/*.cpp' |
  xargs -P 2 -I{} bash -c 'check {} || { echo "lint: {} (above)"; exit 1; }'
