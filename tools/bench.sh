#!/usr/bin/env bash
# Builds and runs every benchmark. Arguments go to each of them, as in: tools/bench.sh --benchmark_filter=Add
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. tools/packages.sh

build="build-bench"
install_missing "${build_packages[@]}" "${bench_packages[@]}"
echo "Building in $build ..."
configure "$build" -DCLRATIO_BENCH=ON -DCLRATIO_TESTS=OFF
quietly "$build/build.log" cmake --build "$build" --parallel "$(nproc)"

export POCL_CACHE_DIR=$PWD/$build/pocl_cache XDG_CACHE_HOME=$PWD/$build/cache
mkdir -p "$POCL_CACHE_DIR"
for bench in "$build"/*_bench; do
    printf '\n%s\n' "$(basename "$bench")"
    "$bench" "$@"
done
