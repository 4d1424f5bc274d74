# shellcheck shell=bash
# What clratio needs from Debian, and how the scripts here get it. Sourced by demo.sh, check.sh and bench.sh.

# To build the library and the command line, and to run them on the CPU.
# shellcheck disable=SC2034
build_packages=(
    g++ cmake ninja-build pkg-config
    opencl-headers ocl-icd-opencl-dev pocl-opencl-icd
    libboost-dev libcli11-dev libfmt-dev libopenexr-dev libpng-dev nlohmann-json3-dev
)
# To build and run the tests, and to check the code.
# shellcheck disable=SC2034
test_packages=(libgtest-dev clang-format-14 oclgrind git gnuplot-nox)
# To build the benchmarks.
# shellcheck disable=SC2034
bench_packages=(libbenchmark-dev librandom123-dev)
# The peers that are not compiled; Intel MKL is timed where the loader finds libmkl_rt.
# shellcheck disable=SC2034
peer_packages=(python3 python3-numpy python3-pyopencl)

installed() { [[ $(dpkg-query --show --showformat='${db:Status-Status}' "$1" 2>/dev/null) == installed ]]; }

# install_missing PACKAGE...: asks apt for those that are not installed, and for nothing where all are.
install_missing() {
    local package missing=() sudo=()
    if ! command -v dpkg-query >/dev/null; then
        echo "Not a Debian system: if the build fails, look for the like of these packages: $*"
        return
    fi
    for package in "$@"; do
        installed "$package" || missing+=("$package")
    done
    ((${#missing[@]})) || return 0
    echo "Installing from Debian: ${missing[*]}"
    ((EUID == 0)) || sudo=(sudo)
    local log
    log=$(mktemp)
    if ! "${sudo[@]}" apt-get update -qq >"$log" 2>&1 </dev/null ||
        ! "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive \
            apt-get install -y -qq --no-install-recommends "${missing[@]}" >"$log" 2>&1 </dev/null; then
        cat "$log" >&2
        echo "The packages could not be installed; the end of apt's own words is above." >&2
        return 1
    fi
    rm -f "$log"
}

# quietly LOG COMMAND...: the command's output goes to LOG, and is shown only if it fails.
quietly() {
    local log=$1
    shift
    "$@" >"$log" 2>&1 </dev/null && return
    cat "$log" >&2
    echo "failed: $*" >&2
    return 1
}

# configure FOLDER OPTION...: a Release build with Ninja, through ccache where there is one. A folder that was configured
# otherwise keeps its generator.
configure() {
    local folder=$1
    shift
    local options=(-DCMAKE_BUILD_TYPE=Release "$@")
    [[ -f $folder/CMakeCache.txt ]] || options+=(-G Ninja)
    command -v ccache >/dev/null && options+=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
    mkdir -p "$folder"
    quietly "$folder/configure.log" cmake -S . -B "$folder" "${options[@]}"
}

# use_pocl FOLDER: PoCL's kernel cache and ours in FOLDER. Where /sys is not mounted (a bare chroot), PoCL's hwloc sees neither
# processors nor memory, and PoCL aborts: it is told.
use_pocl() {
    export POCL_CACHE_DIR=$PWD/$1/pocl_cache XDG_CACHE_HOME=$PWD/$1/cache
    mkdir -p "$POCL_CACHE_DIR"
    [[ -d /sys/devices/system/cpu || ! -r /proc/meminfo ]] && return
    local kilobytes processors
    kilobytes=$(sed -n 's/^MemTotal: *\([0-9]*\) kB/\1/p' /proc/meminfo)
    processors=$(nproc)
    export HWLOC_SYNTHETIC="numa:1(memory=$((kilobytes * 1024))) pu:$processors"
}
