#!/usr/bin/env python3
"""PSNR against bits a voxel: rate_distortion.py --bin BUILD/bin -o FOLDER [INPUT...]

Figure 3 of Guthe and Goesele 2016 for every INPUT, a volume of 8 or 16 bit whole numbers:
  vq        vq-encode --reduce 2 4 8 ... 1024, packed and RBUC codebooks
  near      vq-encode --max-error 0 1 2 4 ... 64, the same
  astc      ASTC with blocks of 3^3 to 6^3 voxels (bench_astc_volume)
  zfp-rate  zfp at fixed rates of 0.125 to 8 bits a voxel
  zfp-prec  zfp at fixed precision, which is no random access: so 24 bits a block are added, for an index
zfp gets integers, scaled to the 31 bits that it has for them, and floats; the plot has what is better on average.
Peak is the full scale of the bit depth, as for voxdiff; lossless is "inf". FOLDER gets figure-3.csv and figure-3.png
(matplotlib), and standard output a table. A run that was stopped goes on where it was; without INPUT it only plots.
Debian has what is needed in libastcenc-dev, zfp and python3-matplotlib; what is not there is left out.
"""
import argparse
import csv
import json
import math
import pathlib
import shutil
import subprocess
import sys
import tempfile

import numpy

REDUCE = [2**i for i in range(1, 11)]
MAX_ERROR = [0] + [2**i for i in range(7)]
RATES = [0.125, 0.25, 0.5, 1, 2, 4, 6, 8]
PRECISIONS = range(3, 25)
COLUMNS = ["volume", "method", "setting", "bits_per_voxel", "psnr_db", "max_abs_error"]
AT = [0.25, 0.5, 1, 1.5, 2, 3, 4, 6]  # bits a voxel of the table
STYLES = {
    "vq rbuc": ("VQ, RBUC", "tab:blue", "o-"),
    "vq packed": ("VQ, packed", "tab:cyan", "o--"),
    "near rbuc": ("near-lossless, RBUC", "tab:green", "s-"),
    "near packed": ("near-lossless, packed", "tab:olive", "s--"),
    "astc": ("ASTC 3³ to 6³", "tab:red", "^-"),
    "zfp-rate": ("zfp, fixed rate", "tab:orange", "v-"),
    "zfp-prec": ("zfp, fixed precision + index", "tab:purple", "d-"),
}


def run(*words):
    done = subprocess.run(list(map(str, words)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, words))}: exit code {done.returncode}: {done.stderr.decode(errors='replace').strip()}")
    return done.stdout


class Results:
    """Rows of the table in a CSV file, which grows with each."""

    def __init__(self, path):
        self.path, self.rows = path, {}
        if path.exists():
            with path.open(newline="") as file:
                for row in csv.DictReader(file):
                    self.keep(row["volume"], row["method"], row["setting"], float(row["bits_per_voxel"]),
                              float(row["psnr_db"]), float(row["max_abs_error"]))

    def keep(self, volume, method, setting, *figures):
        self.rows[volume, method, str(setting)] = figures

    def add(self, volume, method, setting, *figures):
        self.keep(volume, method, setting, *figures)
        print(volume, method, setting, *(f"{figure:.4g}" for figure in figures), file=sys.stderr, flush=True)
        with self.path.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            for key, (bits, psnr, error) in self.rows.items():
                writer.writerow([*key, f"{bits:.5f}", f"{psnr:.3f}", f"{error:g}"])

    def has(self, volume, method, setting):
        return (volume, method, str(setting)) in self.rows

    def volumes(self):
        return list(dict.fromkeys(volume for volume, _, _ in self.rows))

    def curve(self, volume, method):
        """Bits a voxel and PSNR, ascending; lossless points are not on it."""
        points = [(bits, psnr) for (v, m, _), (bits, psnr, _) in self.rows.items()
                  if (v, m) == (volume, method) and math.isfinite(psnr)]
        return numpy.array(sorted(points)).reshape(-1, 2)


class Volume:
    def __init__(self, options, name, folder):
        self.bin, self.threads, self.folder = options.bin, options.threads, folder
        self.input, self.name = name, pathlib.Path(name).name.split(".")[0]
        info = json.loads(run(self.bin / "vox-info", name, "--json"))
        self.dims = info["dims"]
        self.voxels = math.prod(self.dims)
        width = {"u8": "u1", "u16": "<u2"}.get(info["sample_type"])
        if width is None:
            sys.exit(f"{name}: {info['sample_type']} samples: expected u8 or u16")
        raw = folder / "volume.raw"
        run(self.bin / "vox-convert", name, "-o", raw)
        self.values = numpy.fromfile(raw, width)
        self.peak = 255 if width == "u1" else 2**max(1, int(self.values.max()).bit_length()) - 1

    def psnr(self, values):
        """PSNR and the greatest error of numbers that are rounded first."""
        squares, greatest = 0.0, 0.0
        for at in range(0, self.voxels, 1 << 24):  # little memory
            error = numpy.rint(values[at:at + (1 << 24)].astype(float)).clip(0, self.peak) - self.values[at:at + (1 << 24)]
            squares, greatest = squares + float(error @ error), max(greatest, float(abs(error).max()))
        return 10 * math.log10(self.peak**2 * self.voxels / squares) if squares else math.inf, greatest

    def vq(self, results, method, option, setting):
        if all(results.has(self.name, f"{method} {codebook}", setting) for codebook in ("rbuc", "packed")):
            return
        source = self.input
        for codebook in ("rbuc", "packed"):
            out = self.folder / f"{codebook}.vqv"
            words = [option, setting]
            if method == "vq" and codebook == "packed":  # from the other file's bricks, so that k-means runs once
                source, words = self.folder / "rbuc.vqv", []
            run(self.bin / "vq-encode", source, "-o", out, "-f", "-q", "-j", self.threads, "--codebook", codebook, *words)
            diff = json.loads(run(self.bin / "voxdiff", self.input, out, "--json", "-j", self.threads))
            if diff["peak"] != self.peak:
                sys.exit(f"{self.name}: voxdiff's peak is {diff['peak']}, not {self.peak}")
            results.add(self.name, f"{method} {codebook}", setting, 8 * out.stat().st_size / self.voxels,
                        float(diff["psnr_db"]), diff["max_abs_error"])

    def astc(self, results):
        program = self.bin / "bench_astc_volume"
        if not program.exists() or results.has(self.name, "astc", "6x6x6"):
            return
        for r in json.loads(run(program, self.input, "--quality", 60, "-j", self.threads))["results"]:
            results.add(self.name, "astc", "x".join([str(r["block"])] * 3), r["bits_per_voxel"], float(r["psnr_db"]),
                        r["max_abs_error"])

    def zfp(self, results):
        bits = int(self.peak).bit_length()
        samples, out, back = (self.folder / f"volume.{ending}" for ending in ("samples", "zfp", "back"))
        index = 24 * math.prod(-(-side // 4) for side in self.dims)
        # Integers on both sides of 0 suit fixed rates, from 0 upwards fixed precision.
        for method, option, settings, extra, zero in (("zfp-rate", "-r", RATES, 0, 1 << (bits - 1)),
                                                      ("zfp-prec", "-p", PRECISIONS, index, 0)):
            shift = 31 - bits if zero else 30 - bits
            for kind in ("i32", "f32"):
                if all(results.has(self.name, f"{method} {kind}", setting) for setting in settings):
                    continue
                if kind == "i32":
                    ((self.values.astype("<i4") - zero) << shift).tofile(samples)
                else:
                    self.values.astype("<f4").tofile(samples)
                for setting in settings:
                    run("zfp", option, setting, "-t", kind, "-3", *self.dims, "-i", samples, "-z", out, "-o", back)
                    values = numpy.fromfile(back, "<i4" if kind == "i32" else "<f4")
                    if kind == "i32":
                        values = values / (1 << shift) + zero
                    results.add(self.name, f"{method} {kind}", setting, (8 * out.stat().st_size + extra) / self.voxels,
                                *self.psnr(values))


def at_rate(curve, bits):
    """PSNR of a curve at a rate between two of its points; nan outside."""
    if not len(curve):
        return numpy.full(numpy.shape(bits), numpy.nan)
    return numpy.interp(numpy.log2(bits), numpy.log2(curve[:, 0]), curve[:, 1], numpy.nan, numpy.nan)


def curves(results, volume):
    """All curves of a volume by their names in STYLES; of zfp the better of both kinds of input."""
    found = {}
    for name in STYLES:
        kinds = [results.curve(volume, f"{name} {kind}") for kind in ("i32", "f32")] if "zfp" in name else []
        curve = results.curve(volume, name)
        if kinds:
            bits = numpy.geomspace(0.125, 8, 50)
            gain = numpy.nan_to_num(at_rate(kinds[0], bits) - at_rate(kinds[1], bits))
            curve = kinds[0] if gain.sum() >= 0 else kinds[1]
        if len(curve):
            found[name] = curve
    return found


def table(results):
    for volume in results.volumes():
        print(f"\n| {volume}: PSNR at bits a voxel | " + " | ".join(f"{bits:g}" for bits in AT) + " |")
        print("| --- |" + " ---: |" * len(AT))
        for name, curve in curves(results, volume).items():
            cells = ["" if math.isnan(psnr) else f"{psnr:.1f}" for psnr in at_rate(curve, AT)]
            print(f"| {STYLES[name][0]} | " + " | ".join(cells) + " |")


def plot(results, path):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    volumes = results.volumes()
    figure, axes = pyplot.subplots(1, len(volumes), figsize=(7 * len(volumes), 6), squeeze=False)
    for axis, volume in zip(axes[0], volumes):
        for name, curve in curves(results, volume).items():
            label, colour, style = STYLES[name]
            axis.plot(curve[:, 0], curve[:, 1], style, color=colour, label=label, markersize=4)
        for codebook, label, colour in (("rbuc", "lossless, RBUC", "tab:green"), ("packed", "lossless, packed", "tab:olive")):
            lossless = results.rows.get((volume, f"near {codebook}", "0"))
            if lossless:
                axis.axvline(lossless[0], color=colour, linestyle=":", label=label)
        axis.set(title=volume, xlabel="bits a voxel", ylabel="PSNR (dB)", xscale="log", xlim=(0.06, 18), ylim=(20, 90))
        axis.set_xticks([0.0625, 0.125, 0.25, 0.5, 1, 2, 4, 8, 16], ["1/16", "1/8", "1/4", "1/2", "1", "2", "4", "8", "16"])
        axis.minorticks_off()
        axis.grid(alpha=0.3)
    axes[0][0].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=100)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True, help="folder of the programs")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True, help="folder of the results")
    parser.add_argument("-j", "--threads", type=int, default=0)
    parser.add_argument("inputs", nargs="*", metavar="INPUT")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    results = Results(options.output / "figure-3.csv")
    for name in options.inputs:
        with tempfile.TemporaryDirectory(prefix="voxkit-bench-") as folder:
            volume = Volume(options, name, pathlib.Path(folder))
            for error in MAX_ERROR:
                volume.vq(results, "near", "--max-error", error)
            if shutil.which("zfp"):
                volume.zfp(results)
            for reduce in reversed(REDUCE):
                volume.vq(results, "vq", "--reduce", reduce)
            volume.astc(results)
    if not results.rows:
        sys.exit("no results: give volumes")
    table(results)
    plot(results, options.output / "figure-3.png")


if __name__ == "__main__":
    main()
