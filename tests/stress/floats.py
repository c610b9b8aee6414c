#!/usr/bin/env python3
"""Volumes of floats that are no numbers, infinite, denormal or the greatest there are, in every format of floats and
through every tool: what comes out is what formats/README.md says. Searches for voxels that make it something else."""
import argparse
import json
import math
import random
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

NAN, INF = float("nan"), float("inf")
MOST, LEAST = 3.4028234663852886e38, 1.401298464324817e-45
SPECIAL = [NAN, INF, -INF, MOST, -MOST, LEAST, -LEAST, 1.1754943508222875e-38, 0.0, -0.0, 1.0, -1.0, 1e20, -1e-20]
DIMS = (6, 5, 4)
COUNT = DIMS[0] * DIMS[1] * DIMS[2]


def pack(values, order="<"):
    return struct.pack(f"{order}{len(values)}f", *values)


def unpack(data):
    return list(struct.unpack(f"<{len(data) // 4}f", data))


def bits(value):
    """NaN is NaN, whatever its payload; -0 is not 0."""
    return "nan" if math.isnan(value) else struct.pack("<f", value)


def nrrd(values, order="<", kind="float"):
    data = pack(values, order) if kind == "float" else struct.pack(f"{order}{len(values)}d", *values)
    head = "NRRD0004\ntype: {}\ndimension: 3\nsizes: {} {} {}\nencoding: raw\nendian: {}\n\n".format(
        kind, *DIMS, "little" if order == "<" else "big")
    return head.encode() + data


def nifti(values):
    head = bytearray(352)
    struct.pack_into("<i", head, 0, 348)
    struct.pack_into("<8h", head, 40, 3, *DIMS, 1, 1, 1, 1)
    struct.pack_into("<2h", head, 70, 16, 32)
    struct.pack_into("<8f", head, 76, 1, 1, 1, 1, 1, 1, 1, 1)
    struct.pack_into("<3f", head, 108, 352, 1, 0)
    head[344:348] = b"n+1\0"
    return bytes(head) + pack(values)


def mrc(values):
    head = bytearray(1024)
    struct.pack_into("<10i", head, 0, *DIMS, 2, 0, 0, 0, *DIMS)
    struct.pack_into("<6f", head, 40, *DIMS, 90, 90, 90)
    struct.pack_into("<3i", head, 64, 1, 2, 3)
    head[208:216] = b"MAP " + bytes([0x44, 0x44, 0, 0])
    struct.pack_into("<i", head, 108, 20140)
    return bytes(head) + pack(values)


class Broken(Exception):
    pass


class Tools:
    def __init__(self, folder, work):
        self.folder, self.work = folder, work

    def run(self, tool, *arguments, expect=0):
        done = subprocess.run([str(self.folder / tool), *map(str, arguments)], cwd=self.work, capture_output=True,
                              text=True, timeout=120)
        if done.returncode != expect:
            raise Broken(f"{tool} {' '.join(map(str, arguments))}: exit {done.returncode}: {done.stderr.strip()}")
        return done

    def floats(self, name, *options):
        self.run("vox-convert", name, "-o", "out.raw", "-f", "--quiet", *options)
        return unpack((self.work / "out.raw").read_bytes())


def same(got, expected, what, zeros=True):
    for i, (g, e) in enumerate(zip(got, expected)):
        if bits(g) != bits(e) and not (zeros and g == e == 0):
            raise Broken(f"{what}: voxel {i} is {g}: expected {e}")
    if len(got) != len(expected):
        raise Broken(f"{what}: {len(got)} voxels")


def finite_range(values):
    finite = [v for v in values if math.isfinite(v)]
    return (min(finite), max(finite)) if finite else (0.0, 0.0)


# --- formats: each of them gives the floats that are in the file

def read_nrrd(tools, values):
    for order in "<>":
        (tools.work / "a.nrrd").write_bytes(nrrd(values, order))
        same(tools.floats("a.nrrd"), values, "nrrd", zeros=False)


def read_double(tools, values):
    wide = list(values)
    wide[0], wide[1], wide[2] = 1e300, -1e300, 1e-300  # rounded to nearest: infinite, infinite, 0
    (tools.work / "a.nrrd").write_bytes(nrrd(wide, kind="double"))
    same(tools.floats("a.nrrd"), [INF, -INF, 0.0] + wide[3:], "doubles", zeros=False)


def read_nifti(tools, values):
    (tools.work / "a.nii").write_bytes(nifti(values))
    same(tools.floats("a.nii"), values, "nifti", zeros=False)


def read_mrc(tools, values):
    (tools.work / "a.mrc").write_bytes(mrc(values))
    same(tools.floats("a.mrc"), values, "mrc", zeros=False)


def read_raw(tools, values):
    (tools.work / "a.raw").write_bytes(pack(values))
    same(tools.floats("a.raw", "--dims", "6,5,4", "--type", "f32"), values, "raw", zeros=False)


def through(name, zeros):
    def read(tools, values):
        (tools.work / "a.nrrd").write_bytes(nrrd(values))
        for old in tools.work.glob("b-*"):
            old.unlink()
        tools.run("vox-convert", "a.nrrd", "-o", name, "-f", "--quiet")
        same(tools.floats(name), values, name, zeros)
    return read


# --- tools: a.nrrd is there

def svmm_lossless(tools, values):
    tools.run("svmm-encode", "a.nrrd", "-o", "a.svmm", "-f", "--quiet", "--quality", "100", "--verify")
    same(tools.floats("a.svmm"), values, "svmm, lossless", zeros=False)


def svmm_lossy(tools, values):
    lo, hi = finite_range(values)
    for bound in ("global", "local"):
        tools.run("svmm-encode", "a.nrrd", "-o", "a.svmm", "-f", "--quiet", "--quality", "70", "--bound", bound, "--verify")
        for i, (g, e) in enumerate(zip(tools.floats("a.svmm"), values)):
            if not math.isfinite(e):
                if bits(g) != bits(e):
                    raise Broken(f"svmm, {bound}: voxel {i} is {g}: expected {e}")
            # Of the local bound each of two levels may add as much.
            elif not abs(g - e) <= 0.3 * ((hi - lo) or 1) * (1 + 1e-12) * (1 if bound == "global" else 2):
                raise Broken(f"svmm, {bound}: voxel {i} is {g}: expected {e}")


def vq(tools, values):
    lo, hi = finite_range(values)
    odd = any(math.isinf(v) for v in values)
    for error in (None, (hi - lo) / 1000 or 1.0):
        options = [] if error is None else ["--max-error", repr(error)]
        done = tools.run("vq-encode", "a.nrrd", "-o", "a.vqv", "-f", "--verify", *options)
        if ("infinite became" in done.stderr) != odd:
            raise Broken("vq: what was replaced is not said: " + done.stderr)
        most = error or (hi - lo) / 131070 * 1.0001 + max(abs(lo), abs(hi)) * 2 ** -23 + LEAST
        for i, (g, e) in enumerate(zip(tools.floats("a.vqv"), values)):
            expected = e if math.isfinite(e) or math.isnan(e) else hi if e == INF else lo
            if math.isnan(e) and math.isnan(g):
                continue
            if not abs(g - expected) <= most:
                raise Broken(f"vq: voxel {i} is {g}: expected {expected} for {e}")


def convert(tools, values):
    lo, hi = finite_range(values)
    tools.run("vox-convert", "a.nrrd", "-o", "u8.raw", "--type", "u8", "-f", "--quiet")
    got = (tools.work / "u8.raw").read_bytes()
    for i, (g, e) in enumerate(zip(got, values)):
        share = 0 if hi == lo or math.isnan(e) else min(max((e - lo) / (hi - lo), 0), 1)
        if lo < hi and not abs(g - 255 * share) <= 0.501:
            raise Broken(f"u8: voxel {i} is {g}: expected {255 * share} for {e}")


def diff(tools, values):
    equal = json.loads(tools.run("voxdiff", "a.nrrd", "a.nrrd", "--json", "--fail-max", "0").stdout)
    if equal["psnr_db"] != "inf" or equal["differing_voxels"] != 0 or equal["snr_db"] != "inf":
        raise Broken(f"voxdiff of equal volumes: {equal}")
    others = [0.5 if not math.isfinite(v) else v for v in values]
    (tools.work / "c.nrrd").write_bytes(nrrd(others))
    odd = any(not math.isfinite(v) for v in values)
    apart = json.loads(tools.run("voxdiff", "a.nrrd", "c.nrrd", "--json").stdout)
    if odd and (apart["max_abs_error"] != "inf" or apart["psnr_db"] != "-inf"):
        raise Broken(f"voxdiff of numbers with no numbers: {apart}")


def render(tools, values):
    for name in ("a.nrrd", "a.svmm", "a.vqv"):
        for mode in ("surface", "dvr"):
            tools.run("vox-render", name, "-o", "p.exr", "--size", "16x12", "--mode", mode, "-f", "--quiet")
            image = json.loads(tools.run("voxdiff", "p.exr", "p.exr", "--json").stdout)
            if image["ssim"] != 1:  # NaN if a pixel is no number
                raise Broken(f"vox-render --mode {mode} {name}: a pixel is no number")


CHECKS = [
    (".nrrd, both byte orders", "every float as it is", read_nrrd),
    (".nrrd of doubles", "rounded to nearest: what is too large is infinite", read_double),
    (".nii", "every float as it is", read_nifti),
    (".mrc", "every float as it is", read_mrc),
    (".raw", "every float as it is", read_raw),
    (".vdb", "every float as it is, but −0 may be 0", through("b.vdb", True)),
    ("images, .exr", "every float as it is", through("b-%04d.exr", False)),
    ("svmm-encode --quality 100", "every float as it is", svmm_lossless),
    ("svmm-encode --quality 70", "numbers within δ; NaN and infinities as they are", svmm_lossy),
    ("vq-encode, vq-encode --max-error", "numbers within the bound; NaN as it is; −∞ the least, ∞ the greatest; said", vq),
    ("vox-convert --type u8", "NaN and −∞ are 0, ∞ is 255", convert),
    ("voxdiff", "NaN beside NaN no error, beside a number an infinite one", diff),
    ("vox-render", "every pixel is a number", render),
]
SLOW = {".vdb", "images, .exr", "vox-render"}


def volumes(tries, seed):
    """One special value everywhere, then two, then mixtures that change one voxel, or kind of voxel, at a time."""
    chance = random.Random(seed)
    ramp = [(i % 7 - 3) / 4 for i in range(COUNT)]
    for value in SPECIAL[:max(2, tries // 4)]:
        yield [value] * COUNT
        yield [value if i == 37 else v for i, v in enumerate(ramp)]
    values = list(ramp)
    for number in range(tries):
        if number % 8 == 7:
            a, b = chance.choice(SPECIAL), chance.choice(SPECIAL)
            values = [a if (i // 2 + i // 6) % 2 else b for i in range(COUNT)]
        for _ in range(chance.choice([1, 3, 10])):
            values[chance.randrange(COUNT)] = chance.choice(SPECIAL)
        yield list(values)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=Path, required=True, help="folder of the programs")
    parser.add_argument("--tries", type=int, default=60, help="volumes that are made up (60)")
    parser.add_argument("--seed", type=int, default=1, help="other volumes (1)")
    arguments = parser.parse_args()
    broken, looks = {}, dict.fromkeys((name for name, _, _ in CHECKS), 0)
    with tempfile.TemporaryDirectory() as folder:
        tools = Tools(arguments.bin.resolve(), Path(folder))
        for number, values in enumerate(volumes(arguments.tries, arguments.seed)):
            values = unpack(pack(values))
            for name, _, check in CHECKS:
                if name in SLOW and number % 4 > 1:  # those start programs that load large libraries
                    continue
                looks[name] += 1
                (tools.work / "a.nrrd").write_bytes(nrrd(values))
                try:
                    check(tools, values)
                except Broken as why:
                    broken.setdefault(name, (str(why), values))
    print("## Floats that are no numbers\n\n| what | promise | worst found | | looks |\n| --- | --- | --- | --- | --: |")
    for name, promise, _ in CHECKS:
        print(f"| {name} | {promise} | {broken[name][0] if name in broken else '0 others'} |"
              f" {'**BROKEN**' if name in broken else 'held'} | {looks[name]} |")
    print()
    for name, (_, values) in broken.items():
        print(f"- {name}: `{' '.join(map(repr, values))}`\n")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
