"""What the Python peers share: the same numbers as bench/error_bench.cpp, medians of rates on all cores, one JSON object on stdout."""
import json
import multiprocessing
import os
import statistics
import time

S, A, B = 0.35, -0.175, 0.5  # mu .5, tau 1, sigma_m .5, sigma_t .35, rho 0, canonical form
BINS, LO, HI = 1024, -2, 4


def rate(work, items, repetitions):
    """Median items a second; the first call is not counted."""
    work()
    seconds = []
    for _ in range(repetitions):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return items / statistics.median(seconds)


def on_all_cores(measure):
    """measure(core) gives rates by name; one process a core, all at once; their sums."""
    cores = len(os.sched_getaffinity(0))
    with multiprocessing.Pool(cores) as pool:
        parts = pool.map(measure, range(cores), chunksize=1)
    return {name: sum(part[name] for part in parts) for name in parts[0]}


def report(rates):
    print(json.dumps(rates))


def skip(reason):
    report({"skipped": str(reason)})
