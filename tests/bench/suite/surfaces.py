"""Coloured surfaces: codecs of their colours, and whole files beside other ways to keep them."""
import json
import shutil

from contest import Contest
from data import surfaces
from process import Failed, run
from table import Row

CODECS = [  # the first one is what ratios are of
    ("vws", "e=9.56", ("--codec", "vws")),
    ("vws", "e=9.56, effort 1", ("--codec", "vws", "--effort", 1)),
    ("fws", "e=9.56", ("--codec", "fws")),
    ("palette", "256 colours", ("--codec", "palette")),
    ("BC1", "", ("--codec", "bc1")),
    ("BC7", "", ("--codec", "bc7")),
    ("ASTC", "6x6", ("--codec", "astc", "--quality", 70)),
    ("JPEG", "85", ("--codec", "jpeg", "--quality", 85)),
    ("JPEG 2000", "1 : 10", ("--codec", "jp2", "--quality", 60)),
    ("PNG", "lossless", ("--codec", "png")),
]
PICTURES = ("--no-images", "--path", "orbit:4", "--size", "640x480", "--shade", "none")


def label(what, setting):
    return f"{what} {setting}".strip()


def pack(options, name, source, folder):
    """The surface with its colours as they are."""
    raw = folder / "raw.dagc"
    words = [] if ":" in str(source) or str(source).endswith(".vox") else ["--resolution", 1024]
    run(options.bin / "dagcolor-pack", source, "-o", raw, "--codec", "raw", "-f", "-q", *words)
    return raw


def colors(options, table, add):
    table("Colours of surfaces", "Colours of a voxelised surface; percent is of 24 bits a colour, GRMSE of 0 to 255 a channel. Packing is "
          "of the file with its colours as they are, drawing 4 pictures of 640 x 480; BC1, BC7, ASTC, JPEG, JPEG 2000 and PNG are images "
          "of colours along a Morton curve. Ratios are of times: above 1 the first row is faster.",
          ["data", "what", "setting", "percent", "GRMSE", "greatest error", "pack, s", "its time / ours", "MB", "draw, s",
           "its time / ours", "MB"])
    for name, source in surfaces(options).items():
        folder = options.output / "surfaces" / name.replace(":", "-")
        folder.mkdir(parents=True, exist_ok=True)
        raw = pack(options, name, source, folder)
        there, files = {}, {}
        for what, setting, words in CODECS:
            key = label(what, setting)
            files[key] = folder / f"{len(files)}.dagc"
            command = [options.bin / "dagcolor-pack", raw, "-o", files[key], "-f", "--json", "-j", 1, *words]
            try:
                said = json.loads(run(*command, "--verify").output)
            except Failed as problem:  # a codec that this build has not
                options.left_out.append(f"{key}: {problem}")
                continue
            there[key] = (what, setting, said, command)
        packing = Contest(options.rounds).go({key: one[3] for key, one in there.items()})
        drawing = Contest(options.rounds).go({key: [options.bin / "vox-render", files[key], *PICTURES, "-j", 1] for key in there})
        ours = next(iter(there))
        for key, (what, setting, said, _) in there.items():
            row = Row("colors", name, what, setting,
                      {"bytes": said["color_bytes"], "percent": said["color_percent"], "bits_per_voxel": said["color_bits_per_voxel"],
                       "grmse": said["grmse"], "max_error": said["max_abs_error"]})
            megabytes = 3 * said["color_count"] / 1e6
            for kind, contest in (("encode", packing), ("decode", drawing)):
                row.timed(kind, contest.seconds(key), megabytes, contest.ratio(key, ours), contest.peak_bytes(key))
            known = row.measured
            add(row, [name, what, setting, f"{said['color_percent']:.2f}", f"{said['grmse']:.2f}", f"{said['max_abs_error']:.3g}",
                      *(cell for kind in ("encode", "decode")
                        for cell in (f"{known[f'{kind}_s']:.3g}", row.ratio(kind), f"{known[f'{kind}_peak_mb']:.0f}"))])


def files(options, table, add):
    table("Files of surfaces", "The same voxels and colours, with their geometry, in one file: ours, and what others would keep; "
          "of `.vdb` and `.ply` colours are as they are, and of ours none is further than 9.56 off, or as they are (raw).",
          ["data", "what", "setting", "bytes", "bits a voxel", "times ours"])
    for name, source in surfaces(options).items():
        folder = options.output / "surfaces" / name.replace(":", "-")
        folder.mkdir(parents=True, exist_ok=True)
        raw = pack(options, name, source, folder)
        said = json.loads(run(options.bin / "dagcolor-pack", raw, "-o", folder / "vws.dagc", "-f", "--json").output)
        run(options.bin / "dagcolor-pack", raw, "-o", folder / "zstd.dagc", "-f", "-q", "--zstd", 19)
        found = [("dagcolor-pack", "vws, e=9.56", folder / "vws.dagc"), ("dagcolor-pack", "vws, e=9.56, zstd 19", folder / "zstd.dagc"),
                 ("dagcolor-pack", "raw", raw)]
        for what, ending in (("OpenVDB", "vdb"), ("PLY points", "ply")):
            path = folder / f"points.{ending}"
            run(options.bin / "vox-decode", raw, "-o", path, "-f", "-q")
            found.append((what, "", path))
        for program, level in (("zstd", "-19"), ("xz", "-9")):
            if shutil.which(program):
                path = folder / f"points.ply.{program}"
                run("sh", "-c", f'{program} {level} -c "$0" >"$1"', folder / "points.ply", path)
                found.append(("PLY points", f"{program} {level}", path))
        least = found[0][2].stat().st_size
        for what, setting, path in found:
            size = path.stat().st_size
            row = Row("surfaces", name, what, setting, {"bytes": size, "bits_per_voxel": 8 * size / said["leaf_voxels"]})
            add(row, [name, what, setting, size, f"{8 * size / said['leaf_voxels']:.2f}", f"{size / least:.2f}"])
