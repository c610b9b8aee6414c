"""The tools that are no codecs, beside what else would do their work."""
import shutil
import sys

from contest import Contest
from data import SKULL, Volume, skull
from process import run
from table import Row

COMPARE = """
import sys, numpy
a, b = (numpy.memmap(path, sys.argv[3], "r") for path in sys.argv[1:3])
error = a.astype(float) - b
print((error @ error) / error.size, abs(error).max())
"""


def everyday(options, table, add):
    table("Converting and comparing", "Whole runs with one thread, on the CT. Ratios are of times: above 1 ours is faster.",
          ["data", "what", "setting", "s", "its time / ours", "MB"])
    if not SKULL.exists():
        options.left_out.append("a CT (invesalius-examples)")
        return
    volume = Volume(options, "skull", skull(options))
    folder, b = volume.folder, options.bin
    nrrd = folder / "volume.nrrd"
    run(b / "vox-convert", volume.source, "-o", nrrd, "-f", "-q")
    run(b / "vq-encode", nrrd, "-o", folder / "near.vqv", "--max-error", 8, "-f", "-q")
    run(b / "vox-decode", folder / "near.vqv", "-o", folder / "near.raw", "-f", "-q")
    pairs = [("crop", [b / "vox-convert", nrrd, "-o", folder / "crop.nrrd", "--crop", "64,64,10,192,192,90", "-f", "-q", "-j", 1],
              "unu crop", ["teem-unu", "crop", "-min", 64, 64, 10, "-max", 191, 191, 89, "-i", nrrd, "-o", folder / "unu.nrrd"]),
             ("decompress NRRD, gzip", [b / "vox-convert", folder / "gzip.nrrd", "-o", folder / "plain.nrrd", "-f", "-q", "-j", 1],
              "unu save", ["teem-unu", "save", "-f", "nrrd", "-e", "raw", "-i", folder / "gzip.nrrd", "-o", folder / "unu.nrrd"]),
             ("mean square and greatest error", [b / "voxdiff", volume.raw, folder / "near.raw", *volume.open, "-j", 1],
              "numpy", [sys.executable, "-c", COMPARE, volume.raw, folder / "near.raw", "<u2"])]
    if shutil.which("teem-unu"):
        run("teem-unu", "save", "-f", "nrrd", "-e", "gzip", "-i", nrrd, "-o", folder / "gzip.nrrd")
    else:
        pairs = pairs[2:]
    for what, ours, name, theirs in pairs:
        tool = ours[0].name
        contest = Contest(options.rounds + 2).go({tool: ours, name: theirs})
        for one in (tool, name):
            ratio = contest.ratio(one, tool)
            row = Row("everyday", "skull", one, what, {},
                      {"decode_s": contest.seconds(one), "decode_ratio": ratio.median, "decode_ratio_least": ratio.least,
                       "decode_ratio_greatest": ratio.greatest, "decode_peak_mb": contest.peak_bytes(one) / 1e6})
            add(row, ["skull", one, what, f"{contest.seconds(one):.3f}", ratio, f"{contest.peak_bytes(one) / 1e6:.0f}"])
