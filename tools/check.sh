#!/usr/bin/env bash
# Everything a change must pass: formatting, a build without warnings, the tests. Ends with "N passed, N failed".
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. tools/setup.sh

build="build-check"

# The tracked sources that are not formatted as .clang-format says.
unformatted() {
    git ls-files -z '*.cpp' '*.hpp' '*.h' '*.cl' |
        { xargs -0 clang-format-14 --dry-run -Werror 2>&1 || true; } | sed -n 's/:[0-9]*:[0-9]*: error: .*//p' | sort -u
}

# count ATTRIBUTE: of the <testsuite> in ctest's report.
count() { sed -n '/<testsuite/,/>/s/.*[[:space:]]'"$1"'="\([0-9]*\)".*/\1/p' "$build/tests.xml" | head -n 1; }

install_missing "${build_packages[@]}" "${test_packages[@]}" "${bench_packages[@]}"

failed=0
echo "Formatting ..."
files=$(unformatted)
if [[ -n $files ]]; then
    printf 'Not formatted; clang-format-14 -i does it:\n%s\n' "$files"
    failed=1
fi

echo "Building in $build with warnings as errors ..."
configure "$build" -DCLRATIO_WERROR=ON -DCLRATIO_IO=ON -DCLRATIO_TOOL=ON -DCLRATIO_TESTS=ON -DCLRATIO_BENCH=ON \
    -DCLRATIO_INSTALL=ON
quietly "$build/build.log" cmake --build "$build" --parallel "$(nproc)"

echo "Testing on PoCL ..."
export CLRATIO_DEVICE=${CLRATIO_DEVICE:-cpu}
use_pocl "$build"
rm -f "$build/tests.xml"
ctest --test-dir "$build" --label-exclude '^slow$' --output-on-failure --output-junit tests.xml --parallel "$(nproc)" \
    --progress </dev/null || true
[[ -s $build/tests.xml ]] || {
    echo "ctest wrote no report" >&2
    exit 1
}

failures=$(count failures) total=$(count tests) disabled=$(count disabled) skipped=$(count skipped)
passed=$((total - failures - disabled - skipped))
failed=$((failed + failures))
((skipped + disabled == 0)) || echo "$skipped skipped; $disabled disabled (planted faults that other tests run under oclgrind)"
echo "The slow statistics are left out here: ctest --test-dir $build --label-regex slow --output-on-failure"
echo "$passed passed, $failed failed"
((failed == 0 && passed > 0))
