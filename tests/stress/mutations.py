#!/usr/bin/env python3
"""Damaged files through the programs: each ends in time, within its limit of memory, with 0, 1, 3 or 5 and at most one
line about what is wrong, and leaves no output where it failed.

    mutations.py --bin BUILD/bin [--tries N] [--seed S] [--kind NAME]

A file is made of each kind; a mutation of it, whose checksums are made right again where it has any, goes through every
program that reads it.
"""
import argparse
import os
import pathlib
import random
import resource
import struct
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "refdec"))
from container import xxh64  # noqa: E402

LIMIT = 96 << 20  # --max-memory
BESIDE = 160 << 20  # the program itself, its libraries and their own memory
SECONDS = 20
EXTREMES = [0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << 40, (1 << 63) - 1,
            (1 << 64) - 1]
NAN = struct.unpack("<Q", struct.pack("<d", float("nan")))[0]

INFO, CHECK = ["vox-info", "@"], ["vox-info", "@", "--check"]
DECODE = ["vox-decode", "@", "-o", "out.nrrd", "-f"]
REGION = ["vox-decode", "@", "-o", "out.nrrd", "-f", "--roi", "3,2,1,9,9,9"]
DIFF = ["voxdiff", "@", "@"]
DRAW = ["vox-render", "@", "-o", "out.png", "-f", "--size", "40x30"]
DVR = DRAW + ["--mode", "dvr"]
CONVERT = ["vox-convert", "@", "-o", "out.nrrd", "-f"]
PACKED = [INFO, CHECK, DECODE, REGION, DIFF, DRAW, CONVERT]
VOLUME = [INFO, CONVERT, DIFF, DRAW, ["svmm-encode", "@", "-o", "out.svmm", "-f"],
          ["vq-encode", "@", "-o", "out.vqv", "-f"]]
SURFACE = [["dagcolor-pack", "@", "-o", "out.dagc", "-f", "--resolution", "32"]]

# Of each kind how a file is made, its name, and what it goes through.
KINDS = {
    "svmm": (["svmm-encode", "membrane:40,30,20:1"], "a.svmm", PACKED + [DVR]),
    "svmm thesis": (["svmm-encode", "menger:2", "--layout", "thesis"], "a.svmm", PACKED),
    "svmm zstd": (["svmm-encode", "membrane:40,30,20:1", "--zstd", "3"], "a.svmm", PACKED + [DVR]),
    "svmm packed": (["svmm-encode", "membrane:40,30,20:1", "--layout", "packed", "-q", "100"], "a.svmm", PACKED + [DVR]),
    "svmm bounded": (["svmm-encode", "membrane:40,30,20:1", "--layout", "packed", "--max-error", "3", "--page", "8"],
                     "a.svmm", PACKED + [DVR]),
    "svmm colors": (["svmm-encode", "menger:3", "--layout", "packed", "-q", "100"], "a.svmm", PACKED),
    "svmm indexed": (["svmm-encode", "@few.nrrd", "-q", "100"], "a.svmm", PACKED),
    "vqv": (["vq-encode", "membrane:40,30,20:1"], "a.vqv", PACKED + [DVR]),
    "vqv means": (["vq-encode", "membrane:40,30,20:1", "-k", "40"], "a.vqv", PACKED + [DVR]),
    "vqv zstd": (["vq-encode", "membrane:40,30,20:1", "--zstd", "3"], "a.vqv", PACKED + [DVR]),
    "dagc": (["dagcolor-pack", "menger:2"], "a.dagc", PACKED + [["vox-decode", "@", "-o", "out.vox", "-f"]]),
    "dagc plain": (["dagcolor-pack", "menger:2", "--geometry", "dag"], "a.dagc", PACKED),
    "dagc octree": (["dagcolor-pack", "terrain:40", "--geometry", "octree"], "a.dagc", PACKED),
    "dagc palette": (["dagcolor-pack", "menger:2", "--codec", "palette"], "a.dagc", PACKED),
    "dagc predicted": (["dagcolor-pack", "menger:2", "--codec", "predicted", "-e", "3"], "a.dagc", PACKED),
    "dagc pointer": (["dagcolor-pack", "menger:2", "--counts", "pointer", "--colors", "all"], "a.dagc", PACKED),
    "dagc attributes": (["dagcolor-pack", "@points.ply", "--resolution", "8", "--attributes", "color,opacity,normal,rm,id"], "a.dagc",
                        PACKED + [["vox-decode", "@", "-o", "out.ply", "-f"], ["vox-convert", "@", "-o", "out.dagc", "-f"]]),
    "nrrd": (["vox-convert", "membrane:20,12,8:1"], "a.nrrd", VOLUME),
    "nifti": (["vox-convert", "membrane:20,12,8:1"], "a.nii", VOLUME),
    "gzip": (["vox-convert", "membrane:20,12,8:1"], "a.nii.gz", VOLUME),
    "mrc": (["vox-convert", "membrane:20,12,8:1"], "a.mrc", VOLUME),
    "metaimage": (["vox-convert", "membrane:20,12,8:1"], "a.mha", VOLUME),
    "vtk": (["vox-convert", "membrane:20,12,8:1"], "a.vtk", VOLUME),
    "vti": (["vox-convert", "membrane:20,12,8:1"], "a.vti", VOLUME),
    "npy": (["vox-convert", "membrane:20,12,8:1"], "a.npy", VOLUME),
    "vdb": (["vox-convert", "sphere:16"], "a.vdb", VOLUME),
    "tiff": (["vox-convert", "membrane:20,12,2:1"], "s-%d.tif", VOLUME),
    "png": (["vox-convert", "membrane:20,12,2:1"], "s-%d.png", VOLUME),
    "exr": (["vox-render", "sphere:16", "--size", "16x12"], "a.exr", [INFO, DIFF, CONVERT]),
    "vox": (["vox-decode", "@menger.dagc"], "a.vox", [["dagcolor-pack", "@", "-o", "out.dagc", "-f"]]),
    "ply": (["vox-decode", "@menger.dagc"], "a.ply", SURFACE),
    "dicom": (None, "a.dcm", VOLUME),
}


def few_colors():
    """Blocks of three colours and void as an NRRD file."""
    colors = (b"\0\0\0", b"\xff\x20\x10", b"\x08\xc0\x08", b"\x30\x30\xe0")
    voxels = b"".join(colors[(x // 3 + y // 2 + z // 4) % 4] for z in range(24) for y in range(30) for x in range(40))
    return b"NRRD0005\ntype: uint8\ndimension: 4\nsizes: 3 40 30 24\nkinds: RGB-color domain domain domain\n" \
        b"encoding: raw\n\n" + voxels


def points():
    """Points with all that voxels may have beside colours, but light, as a PLY file."""
    properties = "float x,float y,float z,uchar red,uchar green,uchar blue,uchar alpha,float nx,float ny,float nz,uchar roughness," \
        "uchar metallic,uint label"
    head = "ply\nformat ascii 1.0\nelement vertex 64\n" + "".join(f"property {p}\n" for p in properties.split(",")) + "end_header\n"
    return (head + "".join(f"{i % 8} {i // 8} {i % 5} {i * 4} {255 - i} {i} {i * 3 + 60} {i % 3 - 1} {i % 7 - 3} 1 {i} {i * 2} {i // 9}\n"
                           for i in range(64))).encode()


def dicom():
    """One slice of 8 by 6 pixels of 16 bits, explicit little-endian."""
    def element(group, number, kind, value):
        value += b"\0" * (len(value) % 2)
        long = kind in ("OB", "OW")
        head = struct.pack("<HH2s", group, number, kind.encode())
        return head + (struct.pack("<HI", 0, len(value)) if long else struct.pack("<H", len(value))) + value

    uid = b"1.2.840.10008.5.1.4.1.1.2"
    meta = element(2, 1, "OB", b"\0\1") + element(2, 2, "UI", uid) + element(2, 3, "UI", b"1.2.3") + \
        element(2, 0x10, "UI", b"1.2.840.10008.1.2.1")
    numbers = [(0x10, 6), (0x11, 8), (0x100, 16), (0x101, 12), (0x102, 11), (0x103, 0)]
    body = element(8, 0x16, "UI", uid) + element(8, 0x18, "UI", b"1.2.3") + element(0x20, 0xE, "UI", b"1.2.4") + \
        element(0x20, 0x32, "DS", b"0\\0\\0") + element(0x20, 0x37, "DS", b"1\\0\\0\\0\\1\\0") + \
        element(0x28, 2, "US", struct.pack("<H", 1)) + element(0x28, 4, "CS", b"MONOCHROME2") + \
        b"".join(element(0x28, at, "US", struct.pack("<H", value)) for at, value in numbers[:2]) + \
        element(0x28, 0x30, "DS", b"1\\1") + \
        b"".join(element(0x28, at, "US", struct.pack("<H", value)) for at, value in numbers[2:]) + \
        element(0x28, 0x1052, "DS", b"-1024") + element(0x28, 0x1053, "DS", b"1") + \
        element(0x7FE0, 0x10, "OW", struct.pack("<48H", *range(100, 148)))
    return b"\0" * 128 + b"DICM" + element(2, 0, "UL", struct.pack("<I", len(meta))) + meta + body


def good_magic(data):
    return data[1:4] == b"VOX" and data[-64:-56] == b"VOXTABLE"


def reseal(data):
    """Makes the checksums of a container right: chunks, table, trailer, header."""
    if len(data) < 128 or not good_magic(data):
        return
    (entries,) = struct.unpack_from("<Q", data, len(data) - 48)
    if entries > (len(data) - 128) // 64:
        return
    table = len(data) - 64 - 64 * entries
    for i in range(entries):
        offset, length = struct.unpack_from("<QQ", data, table + 64 * i + 16)
        if offset <= len(data) and length <= len(data) - offset:
            struct.pack_into("<Q", data, table + 64 * i + 32, xxh64(bytes(data[offset:offset + length])))
    struct.pack_into("<Q", data, len(data) - 32, xxh64(bytes(data[table:table + 64 * entries])))
    struct.pack_into("<Q", data, len(data) - 8, xxh64(bytes(data[-64:-8])))
    struct.pack_into("<Q", data, 56, xxh64(bytes(data[:56])))


def mutate(good, moments):
    data = bytearray(good)
    for _ in range(moments.randint(1, 3)):
        # Headers are where most is said.
        most = len(data) if moments.random() < 0.6 else min(len(data), 512)
        if most < 16:
            break
        at, width = moments.randrange(most), moments.choice((1, 2, 4, 8))
        at = min(at, len(data) - width)
        kind = moments.randrange(7)
        old = int.from_bytes(data[at:at + width], "little")
        mask = (1 << 8 * width) - 1
        if kind == 0:
            data[at] ^= 1 << moments.randrange(8)
        elif kind == 1:
            data[at:at + width] = (moments.choice(EXTREMES) & mask).to_bytes(width, "little")
        elif kind == 2:
            data[at:at + width] = ((old + moments.choice((-1, 1))) & mask).to_bytes(width, "little")
        elif kind == 3:
            data[at:at + width] = ((old * moments.choice((2, 3, 256))) & mask).to_bytes(width, "little")
        elif kind == 4:
            at -= at % 8
            data[at:at + 8] = NAN.to_bytes(8, "little")
        elif kind == 5:
            begin = moments.randrange(len(data))
            data[at:at + width] = data[begin:begin + width].ljust(width, b"\0")
        elif len(data) > 200:
            del data[moments.randrange(100, len(data)):]
    reseal(data)
    return data


class Found(Exception):
    pass


def run(command, folder):
    """Exit code, standard error and the greatest resident set."""
    start = time.monotonic()
    with open(folder / "err", "wb") as err:
        process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=err,
                                   preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 1)))
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, (folder / "err").read_bytes().decode(errors="replace"), usage.ru_maxrss << 10, \
        time.monotonic() - start


def judge(command, code, err, peak, folder):
    """Returns the exit code that the run counts as."""
    tool = command[0].rsplit("/", 1)[1]
    own = tuple(f"{name}: " for name in (tool, *(command[1:] if code == 0 else ())))  # or of what was done, of a file
    wrong = [line for line in err.splitlines() if not line.startswith(own)]
    if code == 2 and ("--roi: the box is not inside" in err or "expected larger steps" in err):
        code = 3  # of extents that were changed
    if code not in (0, 1, 3, 5):
        raise Found(f"exit {code}: {err}")
    if wrong:
        raise Found(f"a line of somebody else's: {wrong[0]}")
    if code in (3, 5) and not err:
        raise Found(f"exit {code} without a word")
    if peak > LIMIT + BESIDE:
        raise Found(f"peak of {peak >> 20} MiB")
    if code != 0:
        left = [path.name for path in folder.iterdir() if path.name.startswith(("out", ".out"))]
        if left:
            raise Found(f"exit {code} and {left} is there")
    return code


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--tries", type=int, default=20, help="mutations of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=sorted(KINDS), help="of one kind alone")
    options = parser.parse_args()
    options.bin = options.bin.resolve()
    broken = 0
    print("| kind | mutations | runs | taken | refused | over the limit | greatest peak, MiB | longest, s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        subprocess.run([options.bin / "dagcolor-pack", "menger:2", "-o", folder / "menger.dagc", "-q"], check=True)
        (folder / "few.nrrd").write_bytes(few_colors())
        (folder / "points.ply").write_bytes(points())
        for kind, (make, file, programs) in KINDS.items():
            if options.kind not in (None, kind):
                continue
            if make is None:
                good = dicom()
            else:
                arguments = [folder / a[1:] if a.startswith("@") else a for a in make[1:]]
                done = subprocess.run([options.bin / make[0], *arguments, "-o", folder / file], capture_output=True)
                if done.returncode != 0:
                    print(f"{kind}: left out: {done.stderr.decode().strip()}", file=sys.stderr)
                    continue
                file = file.replace("%d", "1")
                good = (folder / file).read_bytes()
            counts, greatest, longest, runs = {0: 0, 1: 0, 3: 0, 5: 0}, 0, 0.0, 0
            for i in range(options.tries):
                bad = mutate(good, random.Random(f"{options.seed} {kind} {i}"))
                (folder / file).write_bytes(bad)
                for program in programs:
                    command = [str(options.bin / program[0]),
                               *(file if argument == "@" else argument for argument in program[1:]),
                               "--max-memory", str(LIMIT), "-j", "1"]
                    code, err, peak, seconds = run(command, folder)
                    runs += 1
                    try:
                        counts[judge(command, code, err, peak, folder)] += 1
                    except Found as found:
                        broken += 1
                        kept = pathlib.Path(tempfile.gettempdir()) / f"mutation-{options.seed}-{kind}-{i}-{file}"
                        kept.write_bytes(bad)
                        print(f"{kind}, mutation {i}, {' '.join(command[:1] + program[1:])}: {found}; kept as {kept}",
                              file=sys.stderr)
                    greatest, longest = max(greatest, peak), max(longest, seconds)
                    for path in folder.iterdir():
                        if path.name.startswith(("out", ".out")):
                            path.unlink()
            for path in folder.glob(file.split("-")[0] + "-*" if "-" in file else file):
                path.unlink()
            print(f"| {kind} | {options.tries} | {runs} | {counts[0] + counts[1]} | {counts[3]} | {counts[5]} | "
                  f"{greatest >> 20} | {longest:.1f} |", flush=True)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
