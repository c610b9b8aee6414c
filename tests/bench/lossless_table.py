#!/usr/bin/env python3
"""Lossless sizes beside others: lossless_table.py --bin BUILD/bin [--data FOLDER] [INPUT...]

Every INPUT, a scalar volume, is compressed by vq-encode (both codebooks), svmm-encode, zstd -19, xz -9, blosc (bit shuffle and
zstd 9) and reversible zfp, each with one thread, and decompressed again. Prints Markdown: bits a voxel, and beside them seconds of
compression and decompression. --data takes all volumes of a folder's folders (.nrrd .nhdr .nii.gz .mrc .vqv) as well. A program that
is not there is left out: Debian has them in zstd, xz-utils, libblosc1 and zfp.

zstd, xz and blosc get the samples as they are in memory; zfp gets integers as 32 bit numbers, which it asks for. Of floats vq-encode
keeps 65536 levels and no more: those sizes are marked with ~.
"""
import argparse
import array
import ctypes
import ctypes.util
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

ENDINGS = (".nrrd", ".nhdr", ".nii.gz", ".nii", ".mrc", ".vqv")
CODES = {"u8": "B", "i8": "b", "u16": "H", "i16": "h", "f32": "f"}


def run(*words):
    start = time.monotonic()
    done = subprocess.run(list(map(str, words)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, words))}: exit code {done.returncode}: {done.stderr.decode(errors='replace').strip()}")
    return time.monotonic() - start


class Volume:
    """A volume as a .raw file in a folder, and what is known of it."""

    def __init__(self, options, name, folder):
        self.bin, self.folder = options.bin, folder
        self.raw = folder / "volume.raw"
        run(self.bin / "vox-convert", name, "-o", self.raw, "--force")
        said = subprocess.run([str(self.bin / "vox-info"), name, "--json"], stdout=subprocess.PIPE, check=True)
        info = json.loads(said.stdout)
        self.dims = info["dims"]
        self.type = info["sample_type"] if info["sample_type"] in CODES else "f32"
        self.voxels = self.dims[0] * self.dims[1] * self.dims[2]
        self.open = ["--dims", ",".join(map(str, self.dims)), "--type", self.type]

    def files(self, encode, out, decode, back):
        """Runs two commands; bytes of the first one's output, seconds of both. The second one's must be the volume."""
        seconds = run(*encode), run(*decode)
        if back is not None and back.read_bytes() != self.raw.read_bytes():
            sys.exit(f"{' '.join(map(str, encode))}: what comes back differs")
        return (out.stat().st_size, *seconds)

    def voxkit(self, encoder, ending, *words):
        out, back = self.folder / f"volume.{ending}", self.folder / "back.raw"
        lossy = encoder == "vq-encode" and self.type == "f32"
        return self.files([self.bin / encoder, self.raw, "-o", out, "-f", "-q", "-j", 1, *self.open, *words], out,
                          [self.bin / "vox-decode", out, "-o", back, "-f", "-q", "-j", 1], None if lossy else back)

    def vq(self):
        return self.voxkit("vq-encode", "vqv")

    def vq_packed(self):
        return self.voxkit("vq-encode", "vqv", "--codebook", "packed")

    def svmm(self):
        out, back = self.folder / "volume.svmm", self.folder / "back.raw"
        return self.files([self.bin / "svmm-encode", self.raw, "-o", out, "-f", "--quiet", "-j", 1, "-q", 100, *self.open],
                          out, [self.bin / "vox-decode", out, "-o", back, "-f", "-q", "-j", 1], back)

    def zstd(self):
        out, back = self.folder / "volume.zst", self.folder / "back.raw"
        return self.files(["zstd", "-19", "-q", "-f", "--single-thread", self.raw, "-o", out], out,
                          ["zstd", "-d", "-q", "-f", out, "-o", back], back)

    def xz(self):
        out, back = self.folder / "volume.xz", self.folder / "back.raw"
        return self.files(["sh", "-c", 'xz -9 -T1 -c "$1" > "$2"', "sh", self.raw, out], out,
                          ["sh", "-c", 'xz -d -c "$1" > "$2"', "sh", out, back], back)

    def zfp(self):
        samples, out, back = self.raw, self.folder / "volume.zfp", self.folder / "back.raw"
        if self.type != "f32":
            samples = self.folder / "volume.i32"
            values = array.array(CODES[self.type])
            values.frombytes(self.raw.read_bytes())
            samples.write_bytes(array.array("i", values).tobytes())
        kind = ["-t", "f32" if self.type == "f32" else "i32", "-3", *self.dims]
        size, *seconds = self.files(["zfp", "-R", *kind, "-i", samples, "-z", out], out,
                                    ["zfp", "-R", *kind, "-z", out, "-o", back], None)
        if back.read_bytes() != samples.read_bytes():
            sys.exit("zfp: what comes back differs")
        return (size, *seconds)

    def blosc(self):
        library = ctypes.CDLL(ctypes.util.find_library("blosc"))
        library.blosc_init()
        library.blosc_set_compressor(b"zstd")
        data = self.raw.read_bytes()
        # A block of one call may have up to 2 GiB less 16 bytes.
        size = seconds = back = 0
        width = array.array(CODES[self.type]).itemsize
        for at in range(0, len(data), 1 << 30):
            part = data[at:at + (1 << 30)]
            out, again = ctypes.create_string_buffer(len(part) + 16), ctypes.create_string_buffer(len(part))
            start = time.monotonic()
            packed = library.blosc_compress(9, 2, width, ctypes.c_size_t(len(part)), part, out,
                                            ctypes.c_size_t(len(part) + 16))
            middle = time.monotonic()
            library.blosc_decompress(out, again, ctypes.c_size_t(len(part)))
            seconds, back = seconds + middle - start, back + time.monotonic() - middle
            if packed <= 0 or again.raw != part:
                sys.exit("blosc: what comes back differs")
            size += packed
        return size, seconds, back


def methods():
    there = [("vq-encode", Volume.vq), ("packed", Volume.vq_packed), ("svmm-encode", Volume.svmm)]
    there += [(name, method) for name, program, method in (("zstd -19", "zstd", Volume.zstd), ("xz -9", "xz", Volume.xz))
              if shutil.which(program)]
    if ctypes.util.find_library("blosc"):
        there.append(("blosc", Volume.blosc))
    if shutil.which("zfp"):
        there.append(("zfp -R", Volume.zfp))
    return there


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True, help="folder of the programs")
    parser.add_argument("--data", type=pathlib.Path, help="a folder with volumes in its folders")
    parser.add_argument("inputs", nargs="*", metavar="INPUT")
    options = parser.parse_args()
    inputs = list(options.inputs)
    if options.data:
        inputs += [str(path) for path in sorted(options.data.glob("*/*")) if path.name.endswith(ENDINGS)]
    if not inputs:
        parser.error("no volumes: give some, or --data")
    columns = methods()
    print("| volume | type | " + " | ".join(name for name, _ in columns) + " |")
    print("| --- | --- |" + " ---: |" * len(columns), flush=True)
    for name in inputs:
        with tempfile.TemporaryDirectory(prefix="voxkit-bench-") as folder:
            volume = Volume(options, name, pathlib.Path(folder))
            cells = []
            for _, method in columns:
                size, encode, decode = method(volume)
                about = "~" if volume.type == "f32" and method in (Volume.vq, Volume.vq_packed) else ""
                cells.append(f"{about}{8 * size / volume.voxels:.3f} ({encode:.2f} s, {decode:.2f} s)")
            label = pathlib.Path(name).name if "/" in name else name
            dims = "x".join(map(str, volume.dims))
            print(f"| {label} | {dims} {volume.type} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
