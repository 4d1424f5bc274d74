#!/usr/bin/env bash
# From a clean clone to a clean picture: installs what is missing, builds, combines two noisy renders, prints the errors.
# Then the quick convergence study of scenes whose answer is known.
# Writes out/demo/SCENE/{before,after,reference}.exr, out/demo/SCENE.png and out/demo/study/report.html.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. tools/setup.sh

out=out/demo
clratio=build/clratio
batch_counts=(1 2 4 8)

# A build folder that is there already keeps its tests and benchmarks.
build() {
    local options=(-DCLRATIO_TOOL=ON -DCLRATIO_IO=ON)
    [[ -f build/CMakeCache.txt ]] || options+=(-DCLRATIO_TESTS=OFF -DCLRATIO_BENCH=OFF)
    echo "Building $clratio ..."
    configure build "${options[@]}"
    quietly build/build.log cmake --build build --target clratio_tool --parallel "$(nproc)"
}

# combine SCENE BATCHES ESTIMATOR OUTPUT: prints the JSON report.
combine() {
    local data=tests/data/cycles/$1
    local m=("$data"/m_0*.exr) t=("$data"/t_0*.exr)
    "$clratio" combine --m "${m[@]:0:$2}" --t "${t[@]:0:$2}" --tau "$data/t_ref.exr" --reference "$data/m_ref.exr" \
        --estimator "$3" --zero zero -o "$4" --json
}

# field NAME: a number out of the JSON on stdin.
field() { sed -n "s/^ *\"$1\": \([-+.0-9e]*\),\{0,1\}$/\1/p"; }

# Each line writes over the pictures of the one before: those of all batches stay.
table() {
    local scene=$1 n ratio ratios
    printf '  %-8s %12s %12s %16s\n' batches 'plain mean' ratio 'mean of ratios'
    for n in "${batch_counts[@]}"; do
        ratio=$(combine "$scene" "$n" ratio "$out/$scene/after.exr")
        ratios=$(combine "$scene" "$n" mean-of-ratios "$out/$scene/mean-of-ratios.exr")
        printf '  %-8s %12.5f %12.5f %16.5f\n' "$n" "$(field rmse_mean <<<"$ratio")" "$(field rmse <<<"$ratio")" \
            "$(field rmse <<<"$ratios")"
    done
}

pictures() {
    local scene=$1 folder=$out/$1
    combine "$scene" "${batch_counts[-1]}" mean "$folder/before.exr" >/dev/null
    cp "tests/data/cycles/$scene/m_ref.exr" "$folder/reference.exr"
    "$clratio" picture "$folder/before.exr" "$folder/after.exr" "$folder/reference.exr" -o "$out/$scene.png" \
        --titles "plain mean,ratio,reference" >/dev/null
}

scene() {
    mkdir -p "$out/$1"
    printf '\n%s\n' "$2"
    table "$1"
    pictures "$1"
    printf '  pictures: %s   (%s/{before,after,reference}.exr)\n' "$out/$1.png" "$out/$1"
}

install_missing "${build_packages[@]}"
build
use_pocl build
"$clratio" devices >build/devices.log
printf '\nTwo scenes rendered by Blender Cycles, 200x150 pixels, on:\n  %s\n' "$(sed -n 's/^\* [0-9]*:[0-9]* *//p' build/devices.log | head -n 1)"
printf 'Root mean square error against 2048 samples a pixel, after 1 to 8 noisy batches:\n'
scene volume "volume: sunlight through slats into fog, 1 sample a pixel and batch"
scene area "area: soft shadows of an area light, 4 samples a pixel and batch"
cat <<END

The ratio has the unshadowed render's noise divided out, and its error goes on falling; the mean of finished
ratios keeps a bias that no number of batches removes. Your own renders:
  $clratio combine --m shadowed_*.exr --t unshadowed_*.exr --tau unshadowed_exact.exr -o out.exr
END

printf '\nFog with an exact answer: 28 estimators, 4 scenes, N = 1 to 64 samples a pixel ...\n\n'
"$clratio" study --quick -o "$out/study"
