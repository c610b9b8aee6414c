#!/usr/bin/env python3
"""Every program within an address space that is too small for it: from 40 MB up in steps it says so (exit 5, or is not
even started by the system's loader), until it has done its work.

    address_space.py --bin BUILD/bin [--step MB] [--most MB] [--only NAME]
"""
import argparse
import pathlib
import resource
import subprocess
import sys
import tempfile

# What is run in the folder of inputs: a name, and the command; outputs are out.*.
WORK = {
    "svmm-encode": ["svmm-encode", "noise:40:1", "-o", "out.svmm"],
    "vq-encode": ["vq-encode", "noise:40:1", "-o", "out.vqv"],
    "dagcolor-pack": ["dagcolor-pack", "menger:3", "-o", "out.dagc"],
    "dagcolor-pack of a texture": ["dagcolor-pack", "square.obj", "-o", "out.dagc", "--resolution", "64"],
    "dagcolor-pack as png": ["dagcolor-pack", "menger:3", "-o", "out.dagc", "--codec", "png"],
    "vox-decode": ["vox-decode", "a.svmm", "-o", "out.nrrd"],
    "vox-decode to vdb": ["vox-decode", "a.dagc", "-o", "out.vdb"],
    "vox-convert to tif": ["vox-convert", "noise:40:1", "-o", "out-%03d.tif"],
    "vox-convert to png": ["vox-convert", "noise:40:1", "-o", "out-%03d.png"],
    "vox-convert of vdb": ["vox-convert", "a.vdb", "-o", "out.nrrd"],
    "vox-info": ["vox-info", "a.vqv", "--check"],
    "voxdiff": ["voxdiff", "a.svmm", "a.vqv"],
    "voxdiff of images": ["voxdiff", "a.png", "a.png"],
    "vox-render": ["vox-render", "a.svmm", "-o", "out.png", "--size", "200x150"],
    "vox-render to exr": ["vox-render", "a.vqv", "-o", "out.exr", "--size", "200x150", "--mode", "dvr"],
}
INPUTS = [["svmm-encode", "noise:40:1", "-o", "a.svmm"], ["vq-encode", "noise:40:1", "-o", "a.vqv"],
          ["dagcolor-pack", "menger:3", "-o", "a.dagc"], ["vox-convert", "noise:40:1", "-o", "a.vdb"],
          ["vox-render", "sphere:20", "-o", "a.png", "--size", "64x64"]]
LOADER = 127  # of the system, where a library cannot even be mapped


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--step", type=int, default=20)
    parser.add_argument("--most", type=int, default=2000)
    parser.add_argument("--only", choices=WORK)
    options = parser.parse_args()
    options.bin = options.bin.resolve()
    broken = 0
    print("| program | least address space, MB | tried below, each exit 5 |\n| --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for command in INPUTS:
            subprocess.run([options.bin / command[0], *command[1:]], cwd=folder, check=True, capture_output=True)
        (pathlib.Path(folder) / "square.obj").write_text(
            "mtllib square.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\n"
            "f 1/1 2/2 3/3 4/4\n")
        (pathlib.Path(folder) / "square.mtl").write_text("newmtl m\nmap_Kd a.png\n")
        for name, command in WORK.items():
            if options.only not in (None, name):
                continue
            refused = 0
            for limit in range(40, options.most, options.step):
                done = subprocess.run([options.bin / command[0], *command[1:], "-f", "-j", "2"], cwd=folder,
                                      capture_output=True, text=True, timeout=60,
                                      preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS,
                                                                            (limit << 20, limit << 20)))
                if done.returncode == 0:
                    break
                loader = done.returncode == LOADER and "loading shared libraries" in done.stderr
                if "is needed" in done.stderr or "needs the" in done.stderr:
                    print(f"{name}: left out: {done.stderr.strip()}", file=sys.stderr)
                    break
                if done.returncode != 5 and not loader:
                    print(f"{name} at {limit} MB: exit {done.returncode}: {done.stderr.strip()}", file=sys.stderr)
                    broken += 1
                refused += not loader
            else:
                print(f"{name}: not even {options.most} MB are enough", file=sys.stderr)
                broken += 1
            print(f"| {name} | {limit} | {refused} |", flush=True)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
