#!/usr/bin/env python3
"""What keeps the folders apart: which may include what, that their READMEs name their files, lengths, formatting.

usage: house_test.py arrows|readmes|lengths|format
"""
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SKIPPED = 77

# A folder may include files of its own, and of those after the arrow. Folders that are not named here (of tools, of
# tests) may include all but tests, and nothing includes them.
ARROWS = """
formats           ->
formats/image     -> formats
formats/mesh      -> formats formats/image
formats/volume    -> formats formats/image
libpage           -> formats
libsvmm           -> formats formats/volume
libsvmm/packed    -> formats libpage libsvmm
libvq             -> formats formats/volume
libcolor/surface  -> formats formats/mesh
libcolor/terrain  -> formats libcolor/surface
libcolor/terms    -> formats libcolor/surface
libcolor/dag      -> formats libcolor/surface libcolor/terms
libcolor/octree   -> formats libpage libcolor/surface libcolor/terms libcolor/dag
libcolor/faces    -> formats formats/mesh libcolor/surface
libcolor/blocks   -> formats libcolor/surface libcolor/terms
libcolor/palette  -> formats libcolor/surface libcolor/terms libcolor/blocks
libcolor/attributes -> formats libcolor/surface libcolor/terms libcolor/dag libcolor/blocks libcolor/palette
libcolor/predicted -> formats libpage libcolor/surface libcolor/terms
libcolor/textures -> formats formats/image libcolor/surface libcolor/terms libcolor/blocks
libcolor/simplify -> formats libcolor/surface libcolor/terms libcolor/dag
libcolor          -> formats formats/image libcolor/surface libcolor/terms libcolor/dag libcolor/octree libcolor/blocks libcolor/palette libcolor/attributes libcolor/predicted libcolor/textures libcolor/simplify
libcolor/edit     -> formats libcolor libcolor/surface libcolor/terms libcolor/dag libcolor/attributes
libmetrics        -> formats formats/image
librender         -> formats formats/image libcolor/surface
librender/cast    -> formats librender libsvmm libsvmm/packed libcolor libcolor/terms libcolor/dag libcolor/attributes libcolor/surface
librender/dvr     -> formats librender librender/cast libsvmm libsvmm/packed libvq
librender/device  -> formats librender librender/cast librender/dvr libsvmm libvq libcolor libcolor/dag
"""
# Files of a folder that stand below it: the terms that all of libcolor shares.
BELOW = {"libcolor/params.h": "libcolor/terms", "libcolor/encoded_part.h": "libcolor/terms"}
SOURCES = (".cc", ".h", ".cu")
MOST_LINES = 600


def files():
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", "-z"], capture_output=True, text=True)
    if listed.returncode:
        print("skipped: this is no clone of a repository")
        sys.exit(SKIPPED)
    return [name for name in listed.stdout.split("\0") if name and (ROOT / name).exists()]


def folder_of(name):
    return BELOW.get(name, name.rpartition("/")[0])


def arrows():
    allowed = {}
    for line in ARROWS.strip().splitlines():
        folder, _, targets = line.partition("->")
        allowed[folder.strip()] = set(targets.split()) | {folder.strip()}
    known = sorted(allowed, key=len, reverse=True)
    wrong = []
    for folder, targets in allowed.items():  # a table with a cycle would allow anything
        for target in targets - {folder}:
            if list(allowed).index(target) > list(allowed).index(folder):
                wrong.append(f"{folder} -> {target}: expected the table in order, what is included first")
    for name in files():
        if not name.endswith(SOURCES):
            continue
        folder = folder_of(name)
        for included in re.findall(r'^\s*#\s*include "([^"]+)"', (ROOT / name).read_text(), re.M):
            target = folder_of(included)
            if folder in allowed and target not in allowed[folder]:
                wrong.append(f"{name}: includes {included}: expected only {', '.join(sorted(allowed[folder]))}")
            elif target not in allowed and target.split("/")[0] != folder.split("/")[0]:
                if not (folder.startswith("tests") and target.startswith("tools")) and included != "build_info.h":
                    wrong.append(f"{name}: includes {included}, of {target}, which is nobody's to include")
            elif folder == target or target in known:
                continue
    return wrong


def readmes():
    """Every folder with sources has a README.md that names each of them, itself or by its stem."""
    wrong = []
    sources = [n for n in files() if n.endswith(SOURCES) and not n.startswith("tests/")]
    for folder in sorted({name.rpartition("/")[0] for name in sources}):
        readme = ROOT / folder / "README.md"
        if not readme.exists():
            wrong.append(f"{folder}: has no README.md")
            continue
        text = readme.read_text()
        for name in sources:
            if name.rpartition("/")[0] == folder:
                base = name.rpartition("/")[2]
                if not re.search(rf"(?<![\w.]){re.escape(base.rpartition('.')[0])}\b", text):
                    wrong.append(f"{folder}/README.md: does not name {base}")
    return wrong


def lengths():
    wrong = []
    for name in files():
        if name.endswith(SOURCES + (".py",)):
            lines = (ROOT / name).read_text().count("\n")
            if lines > MOST_LINES:
                wrong.append(f"{name}: {lines} lines: expected {MOST_LINES} or fewer: it may hold two ideas")
    return wrong


def formatting():
    if not shutil.which("clang-format"):
        print("skipped: no clang-format here")
        sys.exit(SKIPPED)
    names = [name for name in files() if name.endswith(SOURCES)]
    run = subprocess.run(["clang-format", "--dry-run", "-Werror", *names], cwd=ROOT, capture_output=True, text=True)
    return sorted({line.split(":")[0] + ": expected as clang-format has it" for line in run.stderr.splitlines()
                   if "clang-format-violations" in line})


def main():
    check = {"arrows": arrows, "readmes": readmes, "lengths": lengths, "format": formatting}.get(
        sys.argv[1] if len(sys.argv) == 2 else "")
    if not check:
        sys.exit(__doc__)
    wrong = check()
    for line in wrong:
        print(line)
    print(f"{sys.argv[1]}: {len(wrong)} violations")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
