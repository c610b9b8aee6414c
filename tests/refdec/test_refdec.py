#!/usr/bin/env python3
"""Holds the reference decoder against the tools: VOXKIT_BIN=build/bin python3 test_refdec.py

Without VOXKIT_BIN only the tests that need no tool are run.
"""

import itertools
import json
import os
import random
import struct
import sys
import unittest

sys.dont_write_bytecode = True
from container import Container, Refused, xxh64  # noqa: E402
from helpers import BIN, HERE, ToolCase, container, raw_file, read, write  # noqa: E402
from svmm_decode import Svmm, decode  # noqa: E402

DECODER = os.path.join(HERE, "svmm_decode.py")


# ---- Without tools ---------------------------------------------------------------------------------------------------


class Checksum(unittest.TestCase):
    def test_known_values(self):
        for text, value in ((b"", 0xEF46DB3751D8E999), (b"a", 0xD24EC4F1A98C6E5B), (b"abc", 0x44BC2CF5AD770999),
                            (b"Nobody inspects the spammish repetition", 0xFBCEA83C8A378BF1)):
            self.assertEqual(xxh64(text), value)


class SmallFile(unittest.TestCase):
    """A DENSITY8 volume of 3 × 2 × 2 voxels: one block of 2³ voxels, and a root whose second voxel is terminal."""

    def setUp(self):
        voli = struct.pack("<3QBB6x3d3d2d2d", 3, 2, 2, 3, 1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0)
        svmp = struct.pack("<4BIQ3d24x", 2, 1, 2, 1, 2, 2, 90, 0.1, 255)
        base = struct.pack("<IIQ3QQQQ", 2, 17, 1, 4, 2, 2, 1, 8, 8)
        root = struct.pack("<IIQ3QQQQ", 0, 16, 2, 2, 2, 2, 1, 16, 1)
        self.voli, self.svmp = bytearray(voli), bytearray(svmp + base + root)
        self.base = bytearray(range(1, 9))
        self.root = bytearray(b"\5\7" + bytes(6) + struct.pack("<Q", 1 << 56))

    def chunks(self):
        return [(b"VOLI", 0, 0, bytes(self.voli)), (b"SVMP", 0, 0, bytes(self.svmp)), (b"BLKS", 0, 0, bytes(self.base)),
                (b"BLKS", 1, 0, bytes(self.root))]

    def decode(self, data, level=0):
        return bytes(decode(Svmm(Container(data)), level).bytes)

    def refused(self, data, rule):
        with self.assertRaisesRegex(Refused, rule):
            self.decode(data)

    def test_levels(self):
        data = container(self.chunks())
        self.assertEqual(self.decode(data), bytes((1, 2, 7, 3, 4, 7, 5, 6, 7, 7, 8, 7)))
        self.assertEqual(self.decode(data, 1), bytes((5, 7)))

    def test_any_order_and_unknown_kinds(self):
        chunks = [(b"NEWS", 7, 9, b"x" * 65)] + self.chunks()[::-1] + [(b"NEWS", 7, 9, b"")]
        self.assertEqual(self.decode(container(chunks)), self.decode(container(self.chunks())))

    def test_every_cut_and_every_flip(self):
        data = container(self.chunks())
        for length in range(len(data)):
            self.refused(data[:length], ".")
        used = bytearray(len(data))
        for start, end in ((0, 64), (64, 176), (192, 384), (384, 392), (448, 464), (512, len(data))):
            used[start:end] = b"\1" * (end - start)
        for bit in range(8 * len(data)):
            flipped = bytearray(data)
            flipped[bit // 8] ^= 1 << bit % 8
            if used[bit // 8]:
                self.refused(bytes(flipped), ".")
            else:  # a gap
                self.assertEqual(self.decode(bytes(flipped)), self.decode(data))
        self.refused(data + bytes(64), "truncated")

    def test_container_rules(self):
        chunks = self.chunks()
        self.refused(container(chunks, version=4), "version 4")
        self.refused(container(chunks, codec=3), "codec 3")
        for gone in range(4):
            self.refused(container(chunks[:gone] + chunks[gone + 1:]), "expected exactly one|missing")
            self.refused(container(chunks + [chunks[gone]]), "twice")
        self.refused(container(chunks + [(b"VOLI", 1, 0, bytes(self.voli))]), "exactly one")
        self.refused(container(chunks + [(b"BLKS", 2, 0, b"")]), "belong to no level")
        self.refused(container(chunks[:3] + [(b"BLKS", 1, 0, bytes(self.root) + b"\0")]), "17 bytes, expected 16")

    def test_field_rules(self):
        """Every field that a reader checks, set to a value that it refuses."""
        for chunk, layout, offset, value, rule in (
                ("voli", "<Q", 0, 0, "dimensions"), ("voli", "<Q", 8, (1 << 31) + 1, "dimensions"),
                ("voli", "<B", 24, 0, "format 0"), ("voli", "<B", 24, 7, "format 7"),
                ("voli", "<B", 25, 3, "sample type"),
                ("voli", "<d", 40, float("inf"), "spacing"), ("voli", "<d", 72, float("nan"), "origin"),
                ("svmp", "<d", 24, -1, "delta"), ("svmp", "<d", 32, 0, "delta"),
                ("svmp", "<B", 0, 3, "layout 3"), ("svmp", "<B", 1, 6, "base 6"), ("svmp", "<B", 1, 3, "base alpha"),
                ("svmp", "<B", 1, 2, "blocks of 8 bytes"), ("svmp", "<B", 1, 5, "base bc1"),
                ("svmp", "<I", 4, 1, "levels"), ("svmp", "<I", 4, 0, "levels"), ("svmp", "<Q", 8, 0, "root width"),
                ("svmp", "<Q", 8, 4, "should be the root"), ("svmp", "<Q", 16 + 64, 2, "dimensions"),
                ("svmp", "<I", 64, 3, "block width 3"), ("svmp", "<I", 64, 2048, "block width"),
                ("svmp", "<I", 68, 16, "blocks to a chunk"), ("svmp", "<Q", 72, 2, "mip factor"),
                ("svmp", "<Q", 104, 2, "8 bytes, expected 16"), ("svmp", "<Q", 104, 0, "child 0 of 0|no level"),
                ("svmp", "<Q", 104, 1 << 60, "missing"), ("svmp", "<Q", 112, 9, "blocks of 9 bytes"),
                ("svmp", "<I", 128, 2, "root"), ("svmp", "<Q", 136, 4, "mip factor"), ("svmp", "<Q", 168, 2, "root"),
                ("root", "<Q", 8, 1 << 56 | 1, "child 1 of 1"), ("root", "<Q", 8, 3 << 56, "child 1 of 1"),
                ("root", "<Q", 8, 5 << 56, "outside the volume"), ("root", "<Q", 8, 0, "child of no voxel")):
            self.setUp()
            struct.pack_into(layout, getattr(self, chunk), offset, value)
            with self.subTest(chunk=chunk, offset=offset, value=value):
                self.refused(container(self.chunks()), rule)


# ---- With tools ------------------------------------------------------------------------------------------------------

CASES = (  # built-in, block widths, root width, quality, base, layout
    ("menger:2", "0", 32, 90, "raw", "plain"),  # a single level
    ("menger:2", "2", 32, 90, "raw", "thesis"),
    ("menger:3", "0", 4, 90, "raw", "plain"),
    ("menger:3", "2,4", 4, 80, "raw", "thesis"),
    ("menger:3", "2", 4, 90, "alpha", "plain"),
    ("menger:3", "4", 4, 90, "alpha", "thesis"),
    ("menger:3", "2", 8, 80, "bitmap", "plain"),
    ("menger:3", "2", 4, 80, "bitmap", "thesis"),
    ("menger:3", "8", 8, 80, "bitmap", "thesis"),
    ("menger:3", "4", 8, 90, "bc1", "plain"),
    ("menger:3", "8,2", 2, 90, "bc1", "thesis"),
    ("menger:3", "4", 4, 90, "gray", "plain"),
    ("menger:3", "2", 4, 90, "gray", "thesis"),
    ("sphere:50", "0", 4, 90, "raw", "plain"),
    ("sphere:50", "4", 4, 90, "raw", "thesis"),
    ("sphere:33", "2", 4, 90, "bitmap", "plain"),
    ("sphere:33", "4", 8, 90, "bitmap", "thesis"),
    ("noise:40:1", "0", 4, 100, "raw", "plain"),
    ("noise:23:2", "2", 3, 60, "raw", "plain"),
    ("marschner-lobb:32", "2,4", 4, 95, "raw", "plain"),
    ("marschner-lobb:21", "16", 2, 50, "bitmap", "plain"),
    ("membrane:60,41,13:7", "4", 4, 92, "raw", "plain"),
    ("membrane:37,5,70:8", "0", 4, 92, "raw", "thesis"),
)

SAMPLE_TYPES = (  # of a .raw file; voxel format, bits of a voxel, bases, layouts
    ("rgba8", "RGBA32", 32, "raw bitmap alpha gray bc1", "plain thesis"),
    ("rgb8", "RGB24", 24, "raw bitmap gray bc1", "plain thesis"),
    ("i8", "DENSITY8", 8, "raw bitmap", "plain thesis"),
    ("i16", "DENSITY16", 16, "raw bitmap", "plain"),
    ("f32", "FLOAT32", 32, "raw bitmap", "plain"),
    ("bit", "BITMAP", 1, "raw bitmap", "plain"),
)


@unittest.skipUnless(BIN, "VOXKIT_BIN is not set")
class Tools(ToolCase):
    def encode(self, source, *options):
        self.run_program(os.path.join(BIN, "svmm-encode"), source, "-f", "-o", self.path("x.svmm"),
                         *(() if "--layout" in options else ("--layout", "plain")), *options)
        return self.path("x.svmm")

    def compare(self, file):
        """Levels 0, 1 and the root, decoded by both."""
        info = json.loads(self.run_program(sys.executable, DECODER, "--info", file).stdout)
        for level in sorted({0, min(1, len(info["levels"]) - 1), len(info["levels"]) - 1}):
            with self.subTest(level=level):
                tool, reference = self.decode_both(DECODER, file, "good.raw", "--level", level)
                reference = raw_file(reference, info["sample_type"])
                self.assertEqual(len(tool), len(reference))
                different = [at for at in range(len(tool)) if tool[at] != reference[at]]
                self.assertFalse(different, "{} bytes differ, the first at {}".format(len(different), different[:1]))
        return info

    def test_built_ins(self):
        for source, widths, root, quality, base, layout in CASES:
            with self.subTest(source=source, w=widths, r=root, q=quality, base=base, layout=layout):
                file = self.encode(source, "-w", widths, "-r", root, "--quality", quality, "--base", base, "--layout",
                                   layout)
                info = self.compare(file)
                self.assertEqual((info["params"]["base"], info["params"]["layout"]), (base, layout))

    def test_compressed_chunks(self):
        for options in (("--quality", "100"), ("--quality", "95", "-w", "4")):
            with self.subTest(options=options):
                plain = os.path.getsize(self.encode("membrane:60,50,20:1", *options))
                file = self.encode("membrane:60,50,20:1", "--zstd", "3", *options)
                self.assertLess(os.path.getsize(file), plain)
                self.assertEqual(Container(read(file)).version, 2)
                self.compare(file)

    def test_sample_types(self):
        """All voxel formats and bases: a volume half zero, half noise; as floats some of that are NaN or huge."""
        for kind, voxel_format, bits, bases, layouts in SAMPLE_TYPES:
            size = (13 * 9 * 6 * bits + 7) // 8
            noise = random.Random(1)
            write(self.path("in.raw"), bytes(noise.randrange(256) if at > size // 2 else 0 for at in range(size)))
            for base, layout, width in itertools.product(bases.split(), layouts.split(), (2, 4)):
                if (base, width) != ("bc1", 2):
                    with self.subTest(type=kind, base=base, layout=layout, w=width):
                        file = self.encode(self.path("in.raw"), "--dims", "13,9,6", "--type", kind, "-w", width, "-r", 2,
                                           "--base", base, "--layout", layout)
                        self.assertEqual(self.compare(file)["voxel_format"], voxel_format)

    def test_damaged_files_are_refused(self):
        data = read(self.encode("menger:2", "-w", "2", "-r", "4"))
        damaged = [data[:length] for length in (0, 7, 64, 200, len(data) // 2, len(data) - 64, len(data) - 1)]
        for chunk in Container(data).chunks.values():
            for at in (chunk.offset, chunk.offset + chunk.length - 1):
                damaged.append(data[:at] + bytes((data[at] ^ 16,)) + data[at + 1:])
        for at in (0, 8, 10, 40, len(data) - 90, len(data) - 60, len(data) - 50, len(data) - 1):
            damaged.append(data[:at] + bytes((data[at] ^ 1,)) + data[at + 1:])
        for number, content in enumerate(damaged):
            with self.subTest(number=number):
                write(self.path("bad.svmm"), content)
                self.assertEqual(self.decode_both(DECODER, self.path("bad.svmm"), "bad.raw", expect=3), [None, None])


if __name__ == "__main__":
    unittest.main()
