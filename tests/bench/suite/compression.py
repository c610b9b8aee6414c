"""Volumes compressed and decompressed: without loss, within a bound, and small."""
import json
import sys
from ctypes.util import find_library

import peers
from contest import Contest
from data import Volume, all_volumes, scalar_volumes
from process import run
from table import Row, text

COLUMNS = ["data", "what", "setting", "bits a voxel", "PSNR", "greatest error", "MB/s", "its time / ours", "MB", "decoded MB/s",
           "its time / ours", "MB"]


def lossless_methods(volume):
    """All that is lossless for a volume's type; the first one is what ratios are of."""
    found = [peers.ours(volume, "vq-encode"), peers.ours(volume, "vq-encode", "--codebook", "packed")] \
        if volume.whole_numbers else []
    found += [peers.ours(volume, "svmm-encode", "-q", 100), peers.ours(volume, "svmm-encode", "-q", 100, "-w", 0),
              peers.ours(volume, "svmm-encode", "-q", 100, "--zstd", 9)]
    if volume.type != "rgba8" and peers.has_numpy():
        found.append(peers.openvdb(volume))
    found += peers.installed(("zstd", lambda: peers.zstd(volume, 3)), ("zstd", lambda: peers.zstd(volume, 19)),
                             ("xz", lambda: peers.xz(volume)))
    if find_library("blosc"):
        found.append(peers.blosc(volume))
    if volume.type != "rgba8":
        found += peers.installed(("zfp", lambda: peers.zfp(volume, "-R", "-R")))
    return found


def bounded_methods(volume):
    """All that keep a bound: a hundredth of full scale, 4095 for 12 bits."""
    scale = volume.difference(volume.raw)["peak"]
    bound = max(1, int(scale / 100))
    return [peers.ours(volume, "vq-encode", "--max-error", bound),
            peers.ours(volume, "svmm-encode", "--delta", text(bound / scale)),
            peers.ours(volume, "svmm-encode", "--delta", text(bound / scale), "-w", 0)] + peers.installed(
                ("zfp", lambda: widest_zfp(volume, bound)))


def widest_zfp(volume, bound):
    """zfp with the greatest tolerance, a power of two, that keeps the bound here: it stays far below what it is given."""
    tolerance = 2 ** (bound.bit_length() - 1)
    method = peers.zfp(volume, f"-a {tolerance}", "-a", tolerance)
    while True:
        tolerance *= 2
        wider = peers.zfp(volume, f"-a {tolerance}", "-a", tolerance)
        for words in (wider.encode, wider.decode, wider.finish):
            run(*words)
        if volume.difference(wider.back)["max_abs_error"] > bound:
            return method
        method = wider


def small_methods(volume):
    return [peers.ours(volume, "vq-encode", "--reduce", 16), peers.ours(volume, "svmm-encode", "-q", 90),
            peers.ours(volume, "svmm-encode", "-q", 80), peers.ours(volume, "svmm-encode", "-q", 90, "-w", 0)] + peers.installed(
                ("zfp", lambda: peers.zfp(volume, "-r 1", "-r", 1)), ("zfp", lambda: peers.zfp(volume, "-r 0.5", "-r", 0.5)))


def compete(section, volume, methods, rounds, must_be_equal, add):
    """A row for every method, by its commands in turn; the first one's are what the others are compared with."""
    encode = Contest(rounds).go({m.label: m.encode for m in methods})
    by_label = {m.label: m for m in methods}
    fixed = {}

    def check(label):
        method = by_label[label]
        if method.finish:
            run(*method.finish)
        size = method.file.stat().st_size
        fixed[label] = {"bytes": size, "percent": 100 * size / volume.bytes, "bits_per_voxel": 8 * size / volume.voxels}
        difference = volume.difference(method.back)
        if must_be_equal and difference["differing_voxels"]:
            sys.exit(f"{volume.name}: {label}: what comes back differs")
        fixed[label]["psnr_db"] = difference["psnr_db"]
        fixed[label]["max_error"] = difference["max_abs_error"]
        method.back.unlink()

    decode = Contest(rounds).go({m.label: m.decode for m in methods}, check)
    for method in methods:
        row = Row(section, volume.name, method.what, method.setting, fixed[method.label])
        for kind, contest in (("encode", encode), ("decode", decode)):
            row.timed(kind, contest.seconds(method.label), volume.megabytes, contest.ratio(method.label, methods[0].label),
                      contest.peak_bytes(method.label))
        add(row, [*described(row), *speed(row, "encode"), *speed(row, "decode")])
        method.file.unlink()


def described(row):
    known = row.fixed
    psnr = known["psnr_db"]
    return [row.data, row.what, row.setting, f"{known['bits_per_voxel']:.3f}", "∞" if psnr == "inf" else f"{psnr:.2f}",
            f"{known['max_error']:g}"]


def speed(row, kind):
    known = row.measured
    return [f"{known[f'{kind}_mb_per_s']:.4g}", row.ratio(kind), f"{known[f'{kind}_peak_mb']:.0f}"]


def lossless(options, table, add):
    table("Lossless", "Volumes compressed without loss, each method with one thread, whole runs with reading and writing files. "
          "Ratios are of times: above 1 the first row of the volume is faster; in brackets the least and the greatest of the rounds.",
          COLUMNS)
    for name, source in all_volumes(options).items():
        volume = Volume(options, name, source)
        compete("lossless", volume, lossless_methods(volume), options.rounds, volume.type != "f32", add)


def bounded(options, table, add):
    table("Within a bound", "No voxel further than a hundredth of full scale from the original.", COLUMNS)
    for name, source in scalar_volumes(options).items():
        volume = Volume(options, name, source)
        if volume.whole_numbers:
            compete("bounded", volume, bounded_methods(volume), options.rounds, False, add)


def small(options, table, add):
    table("Small", "Without a bound: k-means, mip-maps, fixed rates; ASTC, by its library, with blocks of 4³ and 6³ voxels.",
          COLUMNS)
    for name, source in scalar_volumes(options).items():
        volume = Volume(options, name, source)
        if not volume.whole_numbers:
            continue
        compete("small", volume, small_methods(volume), options.rounds, False, add)
        astc(volume, add)


def astc(volume, add):
    program = volume.bin / "bench_astc_volume"
    if not program.exists():
        return
    if volume.voxels >= 8 << 20:  # it takes 4 microseconds a voxel and size of block
        return
    said = json.loads(run(program, volume.source, "-j", 1, "--block", "4,6", "--json").output)
    for one in said["results"]:
        row = Row("small", volume.name, "ASTC", "x".join([str(one["block"])] * 3),
                  {"bytes": one["file_bytes"], "percent": 100 * one["file_bytes"] / volume.bytes,
                   "bits_per_voxel": one["bits_per_voxel"], "psnr_db": one["psnr_db"], "max_error": one["max_abs_error"]},
                  {"encode_s": one["encode_seconds"], "encode_mb_per_s": volume.megabytes / one["encode_seconds"],
                   "decode_s": one["decode_seconds"], "decode_mb_per_s": volume.megabytes / one["decode_seconds"]})
        add(row, [*described(row), f"{row.measured['encode_mb_per_s']:.4g}", "", "",
                  f"{row.measured['decode_mb_per_s']:.4g}", "", ""])
