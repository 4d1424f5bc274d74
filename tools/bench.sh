#!/usr/bin/env bash
# Builds and runs every benchmark. Arguments go to each of them, as in: tools/bench.sh --benchmark_filter=Add
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. tools/setup.sh

build="build-bench"
install_missing "${build_packages[@]}" "${bench_packages[@]}"
echo "Building in $build ..."
configure "$build" -DCLRATIO_BENCH=ON -DCLRATIO_TESTS=OFF -DCLRATIO_TOOL=OFF -DCLRATIO_IO=OFF
quietly "$build/build.log" cmake --build "$build" --parallel "$(nproc)"

use_pocl "$build"
for bench in "$build"/*_bench; do
    printf '\n%s\n' "$(basename "$bench")"
    "$bench" "$@"
done
