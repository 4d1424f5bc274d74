#!/usr/bin/env python3
"""The table of ratios out of one run of tools/bench.sh.

bench_table.py --text|--markdown|--json|--record RESULTS_FOLDER
"""
import datetime
import json
import os
import statistics
import sys
from dataclasses import dataclass, field
from pathlib import Path

RECORD, BEGIN, END = Path("docs/benchmarks.md"), "<!-- table -->\n", "<!-- end of table -->\n"
SIZES = [10**e for e in range(5, 9)]
LARGE = 10**7  # from here on the targets of what streams memory hold


@dataclass
class Rate:
    """Items or bytes a second: the median, and (largest - least) / median over the repetitions."""
    median: float
    spread: float = 0.0


@dataclass
class Row:
    work: str
    ours: tuple  # (file, case)
    limit: tuple = None
    at_least: float = None  # of the limit
    peers: dict = field(default_factory=dict)  # name: (file, case)
    times_peer: tuple = None  # (name of peer, at least)
    unit: str = "items"
    mix: tuple = None  # a pass that only reads and writes as the row does
    at_least_of_mix: float = None


def rows():
    yield from error_rows()
    yield from histogram_rows()
    yield from stream_rows()
    yield from medium_rows()
    yield from memory_rows()
    yield from estimator_rows()
    yield from alone_rows()
    yield from fixed_rows()
    for law in ("pdf", "cdf"):
        yield Row(f"exact law, {law}, float", ("law", f"device/{law}"), peers={"host, one core, double": ("law", f"host/{law}")})


def error_rows():
    others = {"Random123": ("error", "random123"), "std::mt19937": ("error", "standard_library"),
              "NumPy x cores": ("numpy", "samples")}
    for generator, times in (("pcg4d3x", 12), ("philox", 7)):
        yield Row(f"error samples to memory, {generator}", ("error", f"error_samples_float/{generator}"),
                  ("error", f"native/{generator}"), 0.95, others, ("Random123", times))
    yield Row("error samples to memory, double, philox", ("error", "error_samples_double/philox"))


def histogram_rows():
    numpy = {"NumPy x cores": ("numpy", "fused")}
    for generator, times in (("pcg4d3x", 9), ("philox", 6)):
        yield Row(f"error histogram, fused, {generator}", ("histogram", f"one_model/{generator}"),
                  ("histogram", f"native/{generator}"), 0.9, numpy, ("NumPy x cores", times))
    for generator in ("pcg4d3x", "philox"):
        yield Row(f"the same, 10^4 models, {generator} (limit: one model)", ("histogram", f"models_10000/{generator}"),
                  ("histogram", f"one_model/{generator}"), 0.7)
    yield Row("error histogram, fused, double, philox", ("histogram", "one_model_double/philox"))
    yield Row("histogram of values in memory", ("histogram", "values_in_memory"),
              peers={"NumPy x cores": ("numpy", "histogram")})


def medium_rows():
    numpy = {"NumPy x cores": ("numpy_medium", "wvds_mis")}
    yield Row("scene samples, WVDS-MIS, philox (limit without set-up)", ("medium", "image/wvds_mis_philox"),
              ("medium", "native/wvds_mis_philox"), 0.8, numpy, ("NumPy x cores", 10))
    yield Row("scene samples, WVDS-MIS, pcg4d3x", ("medium", "image/wvds_mis_pcg4d3x"))
    for sampling in ("uni", "ds", "dsa", "dsm", "wvds_mean", "wvds_min"):
        yield Row(f"scene samples, {sampling.replace('_', '-')}, philox", ("medium", f"image/{sampling}_philox"))
    for sampling in ("uni", "wvds_mis"):
        yield Row(f"scene errors, fused, {sampling.replace('_', '-')}, philox", ("medium", f"errors/{sampling}_philox"))


def stream_rows():
    others = {"Boost.Compute": ("stream", "boost_compute_normals"), "pyopencl": ("pyopencl", "normals"),
              "MKL x cores": ("mkl", "normals"), "NumPy x cores": ("numpy", "normals")}
    for generator in ("pcg4d3x", "philox"):
        yield Row(f"words to memory, {generator}", ("stream", f"words/{generator}"))
        yield Row(f"normals to memory, {generator}", ("stream", f"normals_float/{generator}"), peers=others)
    yield Row("uniforms to memory, philox", ("stream", "uniforms_float/philox"))
    yield Row("normals to memory, double, philox", ("stream", "normals_double/philox"))


def memory_rows():
    """Bytes a second, beside the in-place scaling of as many bytes."""
    combine = {"combine, stateless, over m": ("tau_image", "tau_image"), "combine, stateless, output apart": ("tau_image_apart", "tau_image"),
               "combine, stateless, tau a number": ("tau_number", "tau_number")}
    moments = {"add 1 batch": "add/1", "add 8 batches": "add/8", "add 1 batch, skip": "add/1_skip",
               "add 8 batches, skip": "add/8_skip", "add 1 batch and read out": "add/1_and_read_out",
               "merge": "merge/propagate", "read out": "read_out/propagate", "read out, skip": "read_out/skip"}
    for size in SIZES:
        at_least = 0.9 if size >= LARGE else None
        for name, (case, limit) in combine.items():
            yield Row(f"{name}, {power(size)}", ("combine", f"stateless/{case}/{size}"), ("combine", f"limit/{limit}/{size}"),
                      at_least, mix=("combine", f"mix/{case}/{size}"), unit="bytes")
        for name, case in moments.items():
            mix = {"merge/propagate": "merge", "read_out/propagate": "read_out"}.get(case, case.replace("/", "_"))
            yield Row(f"{name}, {power(size)}", ("moments", f"{case}/{size}"), ("moments", f"limit/{size}"), at_least,
                      mix=("moments", f"mix/{mix}/{size}"), unit="bytes")


def estimator_rows():
    """Estimate and error; those over groups read 8 of them."""
    for name in ("mean", "ratio", "beale", "tin", "regression", "hartley-ross", "mean-of-ratios", "jackknife", "mickey",
                 "crossfit-regression"):
        yield Row(f"read out {name}, {power(LARGE)}", ("estimator", f"read_out/{name}/{LARGE}"),
                  ("estimator", f"limit/{LARGE}"), mix=("estimator", f"mix/{name}/{LARGE}"), at_least_of_mix=1 / 1.2, unit="bytes")


def alone_rows():
    """The estimate without its error."""
    for name in ("ratio", "mickey"):
        yield Row(f"read out {name} alone, {power(LARGE)}", ("estimator", f"alone/{name}/{LARGE}"),
                  ("estimator", f"limit/{LARGE}"), mix=("estimator", f"mix_alone/{name}/{LARGE}"), at_least_of_mix=1 / 1.2, unit="bytes")


def fixed_rows():
    for name, case in {"add 1 batch": "add_fixed/1", "add 8 batches": "add_fixed/8", "merge": "merge_fixed", "moments()": "moments"}.items():
        yield Row(f"fixed point, {name}, {power(LARGE)}", ("fixed", f"{case}/{LARGE}"), ("fixed", f"limit/{LARGE}"), unit="bytes")


def power(size):
    return f"10^{len(str(size)) - 1} values"


class Results:
    """Rates by (file, case, unit), and why a case has none."""

    def __init__(self, folder):
        self.folder, self.rates, self.reasons, self.seconds = Path(folder), {}, {}, {}
        for path in sorted(self.folder.glob("*.json")):
            content = self.load(path)
            if "benchmarks" in content:
                self.add_benchmarks(path.stem, content["benchmarks"])
            elif path.stem in ("numpy", "numpy_medium", "pyopencl", "mkl"):
                self.add_peer(path.stem, content)
        self.start = self.load(self.folder / "start.json")
        self.devices = self.load(self.folder / "devices.json")

    @staticmethod
    def load(path):
        try:
            return json.loads(path.read_text())
        except (OSError, ValueError):
            return {}

    def add_benchmarks(self, file, runs):
        collected = {}
        for run in runs:
            case = run["run_name"].removesuffix("/process_time/real_time")
            if run.get("error_occurred"):
                self.reasons[file, case] = run["error_message"]
            elif run["run_type"] == "iteration":
                collected.setdefault(case, []).append(run)
        for case, repeated in collected.items():
            self.seconds[file, case] = statistics.median(run["real_time"] for run in repeated) * 1e-9
            for unit in ("items", "bytes"):
                rates = [run[f"{unit}_per_second"] for run in repeated if f"{unit}_per_second" in run]
                if rates:
                    median = statistics.median(rates)
                    self.rates[file, case, unit] = Rate(median, (max(rates) - min(rates)) / median)

    def add_peer(self, file, content):
        if "skipped" in content:
            self.reasons[file, ""] = content["skipped"]
        else:
            for case, rate in content.items():
                self.rates[file, case, "items"] = Rate(rate)

    def rate(self, of, unit="items"):
        return self.rates.get((*of, unit)) if of else None


def verdict(ratio, wanted, what):
    if ratio >= wanted:
        return f"{what} >= {wanted:g}: met"
    return f"{what} >= {wanted:g}: missed by {100 * (1 - ratio / wanted):.0f} %"


def verdict_at_most(ratio, wanted, what):
    if ratio <= wanted:
        return f"{what} <= {wanted:g}: met"
    return f"{what} <= {wanted:g}: missed by {100 * (ratio / wanted - 1):.0f} %"


def rate_line(results, row):
    ours = results.rate(row.ours, row.unit)
    if not ours:
        return None
    limit = results.rate(row.limit, row.unit)
    peers = {name: peer for name, of in row.peers.items() if (peer := results.rate(of, row.unit))}
    targets = []
    if limit and row.at_least:
        targets.append(verdict(ours.median / limit.median, row.at_least, "of the limit"))
    mix = results.rate(row.mix, row.unit)
    if mix and row.at_least_of_mix:
        targets.append(verdict(ours.median / mix.median, row.at_least_of_mix, "of the mix"))
    if row.times_peer and row.times_peer[0] in peers:
        name, times = row.times_peer
        targets.append(verdict(ours.median / peers[name].median, times, f"x {name}"))
    return {
        "work": row.work, "unit": row.unit, "ours": ours.median, "spread": ours.spread,
        "limit": limit.median if limit else None, "of_limit": ours.median / limit.median if limit else None,
        "mix": mix.median if mix else None, "of_mix": ours.median / mix.median if mix else None,
        "peers": {name: {"rate": peer.median, "times": ours.median / peer.median} for name, peer in peers.items()},
        "targets": targets,
    }


def eight_batches(results):
    """The time of 8 batches in one launch over that of one."""
    for size in SIZES:
        for kind in ("", "_skip"):
            one, eight = (results.seconds.get(("moments", f"add/{k}{kind}/{size}")) for k in (1, 8))
            if one and eight:
                name = f"8 batches in one launch over 1{kind.replace('_', ', ')}, {power(size)}"
                target = [verdict_at_most(eight / one, 2.5, "times")] if size >= LARGE else []
                yield {"what": name, "value": f"{eight / one:.2f} times", "targets": target}


def first_results(results):
    start = results.start
    if not start:
        return
    yield {"what": "a bare program that opens the device and lists it", "value": f"{start['bare']:.3f} s", "targets": []}
    for name, what in (("devices", "`clratio devices`, warm cache"), ("combine", "`clratio combine`, 2 batches of 200x150, warm cache")):
        times = start[name] / start["bare"]
        yield {"what": what, "value": f"{start[name]:.3f} s = {times:.2f} bare", "targets": [verdict_at_most(times, 2, "x bare")]}
    large = start["large_combine"]
    share = large["device"] / large["total"]
    yield {"what": "`clratio combine`, 2 batches of 3840x2160 RGB: device",
           "value": f"{large['device']:.2f} s of {large['total']:.2f} s = {100 * share:.0f} % "
                    f"(decode {large['decode']:.2f} s over all threads, encode {large['encode']:.2f} s)",
           "targets": [verdict_at_most(share, 0.1, "share")]}


def notes(results):
    for (file, case), reason in results.reasons.items():
        yield f"{file}{'/' + case if case else ''}: skipped, {reason}"
    for name in ("NumPy", "pyopencl"):
        if not any(key[0] == name.lower() for key in (*results.rates, *results.reasons)):
            yield f"{name.lower()}: no result, see its log in {results.folder}"


def machine(results):
    cpu = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), "?")
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    picked = next((d for d in results.devices.get("devices", []) if d["id"] == results.devices["picked"]), {})
    load = (results.folder / "uptime").read_text().rsplit("load average:", 1)[-1].strip()
    return [f"{datetime.date.today()}; {cpu}, {len(os.sched_getaffinity(0))} cores, {memory:.0f} GiB",
            f"{picked.get('name', '?')}; {picked.get('platform', '?')}, {picked.get('version', '?')}",
            f"load average before the run: {load}" + ("" if float(load.split(",")[0]) < 0.5 else " (NOT a quiet machine)")]


def si(rate, unit):
    for factor, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if rate >= factor:
            return f"{rate / factor:.3g} {letter}{'B' if unit == 'bytes' else ''}/s"
    return f"{rate:.3g} /s"


RATE_HEADER = ["work", "this library", "spread", "limit", "of limit", "of mix", "peers: rate (this library is .. times as fast)", "target"]
OTHER_HEADER = ["what", "measured", "target"]


def rate_cells(line):
    peers = "; ".join(f"{name} {si(p['rate'], line['unit'])} ({p['times']:.1f}x)" for name, p in line["peers"].items())
    return [line["work"], si(line["ours"], line["unit"]), f"{100 * line['spread']:.0f} %",
            si(line["limit"], line["unit"]) if line["limit"] else "", f"{line['of_limit']:.2f}" if line["limit"] else "",
            f"{line['of_mix']:.2f}" if line["mix"] else "", peers, "; ".join(line["targets"])]


def other_cells(line):
    return [line["what"], line["value"], "; ".join(line["targets"])]


def markdown_table(header, lines):
    yield "| " + " | ".join(header) + " |"
    yield "|" + "---|" * len(header)
    for cells in lines:
        yield "| " + " | ".join(cells) + " |"


def text_table(header, lines):
    widths = [max(len(cells[i]) for cells in (header, *lines)) for i in range(len(header))]
    for cells in (header, *lines):
        yield "  ".join(cell.ljust(width) for cell, width in zip(cells, widths)).rstrip()


def table(results, layout, bullet):
    rates = [rate_cells(line) for line in filter(None, (rate_line(results, row) for row in rows()))]
    others = [other_cells(line) for line in (*eight_batches(results), *first_results(results))]
    parts = [[bullet + line for line in machine(results)], layout(RATE_HEADER, rates), layout(OTHER_HEADER, others),
             [bullet + line for line in notes(results)]]
    return "\n\n".join(text for part in parts if (text := "\n".join(part))) + "\n"


def as_json(results):
    return json.dumps({"machine": machine(results), "rates": list(filter(None, (rate_line(results, row) for row in rows()))),
                       "others": [*eight_batches(results), *first_results(results)], "notes": list(notes(results))}, indent=1)


def record(text):
    page = RECORD.read_text()
    before, rest = page.split(BEGIN)
    RECORD.write_text(before + BEGIN + text + END + rest.split(END)[1])


def main():
    how, results = sys.argv[1], Results(sys.argv[2])
    if how == "--json":
        print(as_json(results))
    elif how == "--text":
        print(table(results, text_table, ""), end="")
    elif how == "--markdown":
        print(table(results, markdown_table, "- "), end="")
    else:
        record(table(results, markdown_table, "- "))


if __name__ == "__main__":
    main()
