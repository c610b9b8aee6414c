"""What the README shows: the files that its pictures were drawn from, and those of scripts/demo.

Their commands are read from where they are written: scripts/README.md and scripts/demo.
"""
import json
import re
import shlex

from data import BRAIN
from process import run
from table import Row

ENCODERS = ("svmm-encode", "vq-encode", "dagcolor-pack")


def picture_commands(source):
    """Encoder, input and options of every picture of gallery/ that scripts/README.md lists."""
    text = (source / "scripts" / "README.md").read_text(encoding="utf-8")
    for line in text.partition("`gallery/`")[2].splitlines():
        words = line.split()
        if line.startswith("    ") and words[0] in ENCODERS and words[2] == "-o":
            yield words[0], words[1], words[4:]


def demo_commands(source):
    """The same of scripts/demo: lines "compare NAME VOLUME TIMES COMMAND...", with options alone in each command."""
    for line in (source / "scripts" / "demo").read_text(encoding="utf-8").splitlines():
        if re.match(r"compare \S+ \S+ \d+ ", line):
            _, _, volume, _, *commands = shlex.split(line)
            for command in commands:
                encoder, *words = command.split()
                yield encoder, volume, words


def find(options, name):
    """A built-in volume, a package's, or a file of the folder of data by its name; None if it is not there."""
    if ":" in name:
        return name
    if name == BRAIN.name and BRAIN.exists():
        return BRAIN
    return next(iter(sorted(options.data.rglob(name))), None) if options.data else None


def shown(options, table, add):
    table("In the README", "Files that its pictures were drawn from, and those of `scripts/demo`; voxels are those of surfaces.",
          ["data", "what", "setting", "bytes", "percent", "of colours", "voxels"])
    out = options.output / "readme"
    for encoder, name, words in [*picture_commands(options.source), *demo_commands(options.source)]:
        path = find(options, name)
        if path is None:
            options.left_out.append(f"{name} of the README's pictures (--data)")
            continue
        said = json.loads(run(options.bin / encoder, path, "-o", out, "-f", "--json", *words).output)
        fixed = {"bytes": said["file_bytes"], "percent": said.get("color_percent", said.get("percent"))}
        if "leaf_voxels" in said:
            fixed |= {"voxels": said["leaf_voxels"], "bits_per_voxel": said["color_bits_per_voxel"], "grmse": said["grmse"]}
        if "psnr_db" in said:  # --verify
            fixed |= {"psnr_db": said["psnr_db"], "max_error": said["max_abs_error"]}
        row = Row("readme", name, encoder, " ".join(words), fixed)
        add(row, [name, encoder, row.setting, said["file_bytes"], f"{said['percent']:.4g}" if "voxels" not in fixed else "",
                  f"{said['color_percent']:.4g}" if "voxels" in fixed else "", fixed.get("voxels", "")])
    out.unlink(missing_ok=True)
