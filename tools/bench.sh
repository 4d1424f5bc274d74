#!/usr/bin/env bash
# Runs every benchmark and every peer in one go and prints the table of ratios.
#   tools/bench.sh [--quick] [--json | --markdown | --record] [--benchmark_...]
# --quick       small sizes, one repetition: for the machinery, not for the record
# --markdown    the table as docs/benchmarks.md holds it; --record writes it there; --json prints it with all rates
# --benchmark_  goes to each of the C++ benchmarks, as in --benchmark_filter=philox
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. tools/setup.sh

build="build-bench"
results="$build/results"
format=--text
repetitions=5
starts=20
small='--benchmark_filter=-/1(0{7}|0{8})/'
options=(--benchmark_min_time=0.2)
extra=()
for argument in "$@"; do
    case $argument in
        --quick)
            repetitions=1 starts=3
            options=(--benchmark_min_time=0.05 "$small")
            ;;
        --text | --json | --markdown | --record) format=$argument ;;
        --benchmark_*) extra+=("$argument") ;;
        *)
            sed -n '2,6s/^# *//p' "${BASH_SOURCE[0]}" >&2
            exit 2
            ;;
    esac
done

# Debian's Python, which has Debian's NumPy and pyopencl, where there is one.
python=python3
[[ -x /usr/bin/python3 ]] && python=/usr/bin/python3

say() { echo "$*" >&2; }

# The table goes to stdout, all else to stderr.
prepare() {
    install_missing "${build_packages[@]}" "${bench_packages[@]}" "${peer_packages[@]}"
    say "Building in $build ..."
    configure "$build" -DCLRATIO_BENCH=ON -DCLRATIO_TOOL=ON -DCLRATIO_IO=ON -DCLRATIO_TESTS=OFF
    quietly "$build/build.log" cmake --build "$build" --parallel "$(nproc)"
    use_pocl "$build"
    rm -rf "$results"
    mkdir -p "$results"
}

# An untimed pass at small sizes fills the caches of built programs. Repetitions of all cases of a benchmark come in a random order,
# so that what else the machine does falls on all of them.
benchmarks() {
    local bench word
    for bench in "$build"/*_bench; do
        word=$(basename "$bench" _bench)
        say "Running $word ..."
        "$bench" --benchmark_min_time=0.001 "$small" "${extra[@]}" >"$results/$word.log" 2>&1 || true
        "$bench" "${options[@]}" --benchmark_repetitions="$repetitions" --benchmark_enable_random_interleaving=true \
            --benchmark_out="$results/$word.json" --benchmark_out_format=json "${extra[@]}" >"$results/$word.log" 2>&1 ||
            say "  failed: see $results/$word.log"
    done
}

peers() {
    local peer device
    device=$("$build/clratio" devices --json | "$python" -c 'import json, sys
all = json.load(sys.stdin)
print(next(d["name"] for d in all["devices"] if d["id"] == all["picked"]))')
    for peer in numpy numpy_medium pyopencl mkl; do
        say "Running $peer ..."
        "$python" "bench/peers/${peer}_peer.py" "$repetitions" "$device" >"$results/$peer.json" 2>"$results/$peer.log" ||
            say "  failed: see $results/$peer.log"
    done
    say "Running first results ..."
    "$python" tools/bench_start.py "$build" "$starts" >"$results/start.json"
}

prepare >&2
"$build/clratio" devices --json >"$results/devices.json"
uptime >"$results/uptime"
benchmarks
peers
"$python" tools/bench_table.py "$format" "$results"
