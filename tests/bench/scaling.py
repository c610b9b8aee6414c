#!/usr/bin/env python3
"""Time and memory against size: scaling.py --bin BUILD/bin -o FOLDER [--quick]

Every tool on inputs of growing size, with 1 and 2 threads, two rounds in turn; then each once on a large one, within --max-memory.
Prints Markdown, and leaves all runs in FOLDER/scaling.csv. --quick: small sizes, to see that everything works.

Exponents are slopes of log(CPU seconds) against log(voxels), by least squares, with their standard errors; the time that a program
takes to start is taken off. Standard output goes nowhere, and files that are read have not been flushed, so no disk is measured.
Bytes moved are those of the input's voxels and of the output, once, by one thread; beside them is what it copies in memory
(bench_bandwidth).
Memory is the largest resident set, less the compressed file that is read: its pages are the system's, which takes them back when
it needs them. It cannot tell less than what starts the programs takes, about 13 MB.
"""
import argparse
import csv
import dataclasses
import json
import math
import os
import pathlib
import statistics
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent / "suite"))
from process import Failed, run  # noqa: E402

ROUNDS = 2
THREADS = (1, 2)
LIMIT = "128M"
FIELDS = ("row", "input", "voxels", "moved_bytes", "threads", "max_memory", "round", "wall_s", "cpu_s", "rss_bytes", "mapped_bytes", "load")
BLOCKS = {"svmm-encode": ("--layout", "plain")}  # whose sizes and times are those of bytes that are moved
ENDINGS = {"svmm-encode": ".svmm", "vq-encode": ".vqv", "dagcolor-pack": ".dagc"}
SURFACE_VOXEL = 16  # bytes, as they come from where they are made


@dataclasses.dataclass
class Series:
    """A tool on inputs that differ in size only."""
    label: str
    tool: str
    inputs: list
    encoder: str           # what makes, of an input, the file that is read, or is this tool itself
    before: bool = False   # the input is read, or comes first
    file: bool = False     # the file is read
    raw_copies: int = 1    # times that all voxels are moved; 0: not all of them are looked at
    options: tuple = ("-o", "-")


def side_of(name):
    kind, size = name.split(":")[:2]
    return 3 ** int(size) if kind == "menger" else int(size)


def raw_bytes_of(name):
    return side_of(name) ** 3 * (4 if name.startswith("menger") else 1)


class Bench:
    def __init__(self, options):
        self.bin, self.folder = options.bin, options.output
        self.rows, self.started, self.counted = [], {}, {}
        self.starts = 1 if options.quick else 5

    def run(self, words, out=os.devnull):
        """Wall and CPU seconds, and the largest resident set, of a run whose standard output goes to a file."""
        done = run(self.bin / words[0], *words[1:], out=out)
        return done.seconds, done.cpu_seconds, done.peak_bytes

    def json(self, words):
        return json.loads(run(self.bin / words[0], *words[1:], "--json").output)

    def made(self, name, encoder):
        """A compressed file, made when it is first asked for, which is not measured."""
        path = self.folder / (name.replace(":", "-") + ENDINGS[encoder])
        if not path.exists():
            part = path.with_suffix(".part")
            self.run([encoder, name, "-o", "-", "--quiet", *BLOCKS.get(encoder, ())], part)
            part.rename(path)
        return path

    def voxels(self, name):
        if not name.startswith("terrain"):
            return side_of(name) ** 3
        if name not in self.counted:
            self.counted[name] = self.json(["vox-info", self.made(name, "dagcolor-pack")])["leaf_voxels"]
        return self.counted[name]

    def moved(self, series, name):
        raw = self.voxels(name) * SURFACE_VOXEL if name.startswith("terrain") else raw_bytes_of(name)
        return series.raw_copies * raw + (self.made(name, series.encoder).stat().st_size if series.encoder else 0)

    def measure(self, series, name, threads, turn, limit="", keep=True):
        """A run; where the output is too large to be made just to be counted, not `keep`."""
        words = [series.tool, *([name] if series.before else []), *([self.made(name, series.encoder)] if series.file else []),
                 *series.options, *BLOCKS.get(series.tool, ()), "--quiet", "--threads", threads, *(["--max-memory", limit] if limit else [])]
        wall, cpu, rss = self.run(words)
        mapped = self.made(name, series.encoder).stat().st_size if series.file else 0
        self.rows.append({"row": series.label, "input": name, "voxels": self.voxels(name),
                          "moved_bytes": self.moved(series, name) if keep else "", "threads": threads, "max_memory": limit, "round": turn,
                          "wall_s": round(wall, 4), "cpu_s": round(cpu, 4), "rss_bytes": rss, "mapped_bytes": mapped,
                          "load": round(os.getloadavg()[0], 2)})
        return self.rows[-1]

    def start_of(self, tool):
        """CPU seconds that a tool takes to start; the terrain's scene is made before its first voxel."""
        if tool not in self.started:
            words = [tool, "terrain:1", "-o", "-", "--threads", 1] if tool == "dagcolor-pack" else [tool, "--version"]
            self.started[tool] = statistics.median(self.run(words)[1] for _ in range(self.starts))
        return self.started[tool]

    def memory(self, series, name, threads):
        return (self.median(series, name, threads, "rss_bytes") - self.median(series, name, threads, "mapped_bytes")) / 1e6

    def median(self, series, name, threads, field, limit=""):
        wanted = (series.label, name, threads, limit)
        return statistics.median(row[field] for row in self.rows
                                 if (row["row"], row["input"], row["threads"], row["max_memory"]) == wanted)

    def cpu(self, series, name, threads):
        return max(self.median(series, name, threads, "cpu_s") - self.start_of(series.tool), 1e-4)


def exponent(points):
    """Slope of log(seconds) against log(voxels), and its standard error; of what takes long enough to be measured."""
    points = [point for point in points if point[1] >= 0.002]
    if len(points) < 3:
        return "–"
    x, y = ([math.log(value) for value in column] for column in zip(*points))
    mean_x, mean_y = statistics.fmean(x), statistics.fmean(y)
    spread = sum((value - mean_x) ** 2 for value in x)
    slope = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y)) / spread
    rest = sum((b - mean_y - slope * (a - mean_x)) ** 2 for a, b in zip(x, y))
    return f"{slope:.2f} ± {math.sqrt(rest / (len(points) - 2) / spread):.2f}"


def all_series(quick):
    """What computing inputs takes, the tools, and what is run once: (series, input, whether its output may be kept)."""
    sponges = [f"menger:{level}" for level in ((1, 2, 3) if quick else (3, 4, 5, 6))]
    noise = [f"noise:{side}:1" for side in ((8, 16, 32) if quick else (64, 128, 256, 512))]
    hills = [f"terrain:{side}" for side in ((16, 32, 64) if quick else (256, 512, 1024))]
    sponge, cube, hill = ("menger:4", "noise:64:1", "terrain:128") if quick else ("menger:7", "noise:1024:1", "terrain:2048")
    picture = ("--path", "orbit:8", "--no-images", "--size", "16x16" if quick else "512x512")
    inputs = [Series("computing voxels", "vox-convert", names, "", before=True) for names in (sponges, noise)]
    encode_sponge = Series("svmm-encode", "svmm-encode", sponges, "svmm-encode", before=True)
    encode_noise = Series("svmm-encode", "svmm-encode", noise, "svmm-encode", before=True)
    decode_noise = Series("vox-decode, SVMM", "vox-decode", noise, "svmm-encode", file=True)
    diff = Series("voxdiff, SVMM and its input", "voxdiff", noise, "svmm-encode", before=True, file=True, raw_copies=2, options=())
    surface = Series("dagcolor-pack", "dagcolor-pack", hills, "dagcolor-pack", before=True)
    series = [
        encode_sponge, encode_noise,
        Series("vox-decode, SVMM", "vox-decode", sponges, "svmm-encode", file=True), decode_noise,
        Series("vq-encode", "vq-encode", noise, "vq-encode", before=True),
        Series("vox-decode, VQ", "vox-decode", noise, "vq-encode", file=True),
        diff,
        Series("vox-render, 8 pictures", "vox-render", sponges, "svmm-encode", file=True, raw_copies=0, options=picture),
        surface,
    ]
    large = [(encode_sponge, sponge, False), (encode_noise, cube, True), (decode_noise, cube, True), (diff, cube, True), (surface, hill, True)]
    return inputs, series, large


def size_of(name):
    return name.split(":")[1]


def table(bench, inputs, series, copied):
    computing = {name: (one, name) for one in inputs for name in one.inputs}
    print("| tool | input | CPU s, 1 thread | exponent | 2 threads | times as fast | GB/s moved | of a copy | computing the input | MB |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for one in inputs + series:
        first, last = one.inputs[0], one.inputs[-1]
        slopes = [exponent([(bench.voxels(name), bench.cpu(one, name, threads)) for name in one.inputs]) for threads in THREADS]
        wall = [bench.median(one, last, threads, "wall_s") for threads in THREADS]
        rate = bench.moved(one, last) / 1e9 / bench.cpu(one, last, 1)
        moved = f"{rate:.2f} | {100 * rate / copied:.1f} %" if one.raw_copies else " | "
        share = ""
        if one.before and last in computing and one not in inputs:
            share = f"{100 * bench.cpu(*computing[last], 1) / bench.cpu(one, last, 1):.0f} %"
        memory = ", ".join(f"{bench.memory(one, name, THREADS[-1]):.0f}" for name in one.inputs)
        print(f"| {one.label} | {first.split(':')[0]} {', '.join(map(size_of, one.inputs))} "
              f"| {bench.cpu(one, first, 1):.3f} … {bench.cpu(one, last, 1):.2f} | {slopes[0]} | {slopes[1]} | {wall[0] / wall[1]:.2f} "
              f"| {moved} | {share} | {memory} |")


def large_table(bench, rows):
    """Runs of large inputs beside the largest of the series."""
    print(f"\n| tool | input | million voxels | s, 2 threads | CPU ns a voxel | of the largest above | MB, --max-memory {LIMIT} |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: |")
    for one, row in rows:
        ns = (row["cpu_s"] - bench.start_of(one.tool)) / row["voxels"] * 1e9
        before = one.inputs[-1]
        ratio = ns / (bench.cpu(one, before, THREADS[-1]) / bench.voxels(before) * 1e9)
        print(f"| {one.label} | {row['input']} | {row['voxels'] / 1e6:.0f} | {row['wall_s']:.1f} | {ns:.3g} | {ratio:.2f} times "
              f"| {(row['rss_bytes'] - row['mapped_bytes']) / 1e6:.0f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True, help="folder of the programs")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True, metavar="FOLDER")
    parser.add_argument("--quick", action="store_true", help="small sizes")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    began = time.perf_counter()
    bench = Bench(options)
    bandwidth = bench.json(["bench_bandwidth", "--threads", THREADS[-1], *(["--megabytes", 1] if options.quick else [])])["rows"]
    inputs, series, large = all_series(options.quick)
    load = os.getloadavg()[0]
    for turn in range(1 if options.quick else ROUNDS):
        for one in inputs + series:
            for name in one.inputs:
                for threads in THREADS:
                    bench.measure(one, name, threads, turn)
    once = [(one, bench.measure(one, name, THREADS[-1], 0, LIMIT, keep)) for one, name, keep in large]
    with open(options.output / "scaling.csv", "w", newline="", encoding="utf-8") as out:
        writer = csv.DictWriter(out, FIELDS)
        writer.writeheader()
        writer.writerows(bench.rows)
    text = "; ".join(f"{row['threads']}: {row['read_gb_per_s']:.1f} read, {row['copy_gb_per_s']:.1f} copied" for row in bandwidth)
    print(f"Memory, GB/s by threads: {text}. Load {load:.2f} before, {os.getloadavg()[0]:.2f} after; {time.perf_counter() - began:.0f} s.\n")
    table(bench, inputs, series, bandwidth[0]["copy_gb_per_s"])
    large_table(bench, once)


if __name__ == "__main__":
    try:
        main()
    except Failed as problem:
        sys.exit(str(problem))
