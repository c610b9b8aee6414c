#!/usr/bin/env python3
"""Holds the reference decoder of VQ files against the tools: VOXKIT_BIN=build/bin python3 test_vq_refdec.py

Without VOXKIT_BIN only the tests that need no tool are run.
"""

import json
import os
import random
import struct
import sys
import unittest

sys.dont_write_bytecode = True
from container import Container, Refused  # noqa: E402
from helpers import BIN, HERE, ToolCase, container, raw_file, read, write  # noqa: E402
from vq_decode import Vq, decode  # noqa: E402

DECODER = os.path.join(HERE, "vq_decode.py")


# ---- Without tools ---------------------------------------------------------------------------------------------------


class SmallFile(unittest.TestCase):
    """A DENSITY8 volume of 13 × 4 × 3 voxels in four bricks: one of 3, two equal ones of 5 and 6, one of 9."""

    def setUp(self):
        self.indirect()

    def common(self, mapping, common):
        self.voli = bytearray(struct.pack("<3QBB6x3d3d2d2d", 13, 4, 3, 3, 1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0))
        self.vqpm = bytearray(struct.pack("<4BIQQ3dQQQI52x", 1, mapping, 8, 0, 0, 3, common, 10, 2, 0, 3, 0, 0, 0))
        # Of 5 and 6, without a transform: c2 = 1, octant 7 has c1 = 1, whose voxels are 6.
        self.code = bytearray((3, 3, 5, 6, 0x01, 0x80, 0xFF, 9, 9))

    def indirect(self):
        """Entries of 2 bits: 3, 5 and 6, again, 9. Number 1 is the common brick."""
        self.common(2, 1)
        self.offs = bytearray(struct.pack("<4I", 0, 2, 0, 4) + bytes((0b11000001,)) + bytes(15))
        self.addr = bytearray(struct.pack("<Q32B", 0, 2, 5, 2, *bytes(29)))

    def direct(self):
        """Entries of 3 bits, relative to 2: address 0 is common, 2 twice, 7."""
        self.common(1, 0)
        self.offs = bytearray(struct.pack("<4I", 2, 2, 0, 5) + struct.pack("<Q", 0b110001001000) + bytes(16))
        self.addr = None

    def chunks(self):
        chunks = [(b"VOLI", 0, 0, bytes(self.voli)), (b"VQPM", 0, 0, bytes(self.vqpm)),
                  (b"OFFS", 0, 0, bytes(self.offs)), (b"CODE", 0, 0, bytes(self.code))]
        return chunks + ([(b"ADDR", 0, 0, bytes(self.addr))] if self.addr is not None else [])

    def decode(self, data):
        return bytes(decode(Vq(Container(data))))

    def refused(self, data, rule):
        with self.assertRaisesRegex(Refused, rule):
            self.decode(data)

    def expected(self):
        row = (3,) * 4 + (5,) * 8 + (9,)
        with_six = (3,) * 4 + (5, 5, 6, 6) * 2 + (9,)
        return bytes(10 + 2 * v for y_z in (row * 4, row * 4, row * 2 + with_six * 2) for v in y_z)

    def test_both_mappings(self):
        self.assertEqual(self.decode(container(self.chunks(), codec=2)), self.expected())
        self.direct()
        self.assertEqual(self.decode(container(self.chunks(), codec=2)), self.expected())

    def test_any_order_and_unknown_kinds(self):
        chunks = [(b"NEWS", 7, 9, b"x" * 65)] + self.chunks()[::-1] + [(b"NEWS", 7, 9, b"")]
        self.assertEqual(self.decode(container(chunks, codec=2)), self.expected())

    def test_escape_and_values(self):
        """Plain codes, and values that are brought into what the format can hold."""
        self.code[2:7] = bytes((0, 255, 255)) + bytes(range(0, 256, 4))[:63] + b"\xff"
        self.addr[9] = 67
        voxels = self.decode(container(self.chunks(), codec=2))
        self.assertEqual(voxels[4:8], bytes((10, 18, 26, 34)))  # 10 + 2 * 0, 4, 8, 12
        self.assertEqual(voxels[4 + 13 * 4 * 2 + 13 * 3:][:4], bytes((255,) * 4))  # codes 176 and above
        struct.pack_into("<d", self.vqpm, 24, -30)
        self.assertEqual(self.decode(container(self.chunks(), codec=2))[4:8], bytes((0, 0, 0, 0)))

    def test_every_cut_and_every_flip(self):
        for make in (self.indirect, self.direct):
            make()
            data = container(self.chunks(), codec=2)
            for length in range(len(data)):
                self.refused(data[:length], ".")
            used, at = bytearray(len(data)), 64
            used[:64] = b"\1" * 64
            for _, _, _, content in self.chunks():
                used[at:at + len(content)] = b"\1" * len(content)
                at += len(content) + -len(content) % 64
            used[at:] = b"\1" * (len(data) - at)
            for bit in range(8 * len(data)):
                flipped = bytearray(data)
                flipped[bit // 8] ^= 1 << bit % 8
                if used[bit // 8]:
                    self.refused(bytes(flipped), ".")
                else:  # a gap
                    self.assertEqual(self.decode(bytes(flipped)), self.decode(data))

    def test_container_rules(self):
        chunks = self.chunks()
        self.refused(container(chunks, codec=1), "codec 1")
        for gone in range(5):
            self.refused(container(chunks[:gone] + chunks[gone + 1:], codec=2), "exactly one|OFFS|CODE|ADDR")
            self.refused(container(chunks + [chunks[gone]], codec=2), "twice")
        for kind in (b"OFFS", b"CODE", b"ADDR"):
            self.refused(container(chunks + [(kind, 0, 2, b"x")], codec=2), "without gaps")
            self.refused(container(chunks + [(kind, 1, 0, b"x")], codec=2), "without gaps")
        self.direct()
        self.refused(container(self.chunks() + [(b"ADDR", 0, 0, bytes(40))], codec=2), "ADDR")

    def test_field_rules(self):
        """Every field that a reader checks, set to a value that it refuses."""
        for make, chunk, layout, offset, value, rule in (
                ("indirect", "voli", "<B", 24, 1, "voxel format RGBA32|sample"),
                ("indirect", "voli", "<Q", 0, 17, "entries|places|OFFS"),
                ("indirect", "vqpm", "<B", 0, 0, "codebook 0"), ("indirect", "vqpm", "<B", 0, 3, "codebook 3"),
                ("indirect", "vqpm", "<B", 0, 2, "ADDR"), ("direct", "vqpm", "<B", 0, 2, "packed"),
                ("indirect", "vqpm", "<B", 1, 0, "mapping 0"), ("indirect", "vqpm", "<B", 1, 3, "mapping 3"),
                ("indirect", "vqpm", "<B", 1, 1, "ADDR"), ("direct", "vqpm", "<B", 1, 2, "ADDR"),
                ("indirect", "vqpm", "<B", 2, 0, "0 bits"), ("indirect", "vqpm", "<B", 2, 17, "17 bits"),
                ("indirect", "vqpm", "<Q", 8, 0, "0 bricks"), ("indirect", "vqpm", "<Q", 8, 5, "5 bricks"),
                ("indirect", "vqpm", "<Q", 8, 2, "id of 2"), ("indirect", "vqpm", "<Q", 16, 3, "id of 3"),
                ("direct", "vqpm", "<Q", 16, 9, "address 9"), ("direct", "vqpm", "<Q", 16, 1 << 20, "address"),
                ("indirect", "vqpm", "<d", 24, 0.5, "base"), ("indirect", "vqpm", "<d", 24, float("nan"), "base"),
                ("indirect", "vqpm", "<d", 24, 131071, "base"), ("indirect", "vqpm", "<d", 24, -65536, "base"),
                ("indirect", "vqpm", "<d", 32, 0, "step"), ("indirect", "vqpm", "<d", 32, 131072, "step"),
                ("indirect", "vqpm", "<d", 32, float("inf"), "step"),
                ("indirect", "offs", "<I", 4, 1, "elsewhere"), ("indirect", "offs", "<I", 12, 3, "elsewhere"),
                ("indirect", "offs", "<I", 12, 1, "elsewhere"), ("indirect", "offs", "<I", 0, 1, "id of 3"),
                ("indirect", "addr", "<Q", 0, 3, "behind its chunk|codes from"),
                ("indirect", "addr", "<Q", 0, 1 << 40, "address"),
                ("indirect", "addr", "<B", 9, 4, "behind its chunk"), ("indirect", "addr", "<B", 10, 3, "behind its"),
                ("indirect", "code", "<B", 2, 7, "codes from 7 to 6"), ("indirect", "code", "<B", 4, 6, "c2 = 6"),
                ("indirect", "code", "<B", 4, 5, "behind its chunk"), ("indirect", "code", "<B", 4, 255, "behind"),
                ("direct", "offs", "<I", 0, 3, "behind|codes from|address")):
            getattr(self, make)()
            struct.pack_into(layout, getattr(self, chunk), offset, value)
            with self.subTest(mapping=make, chunk=chunk, offset=offset, value=value):
                self.refused(container(self.chunks(), codec=2), rule)


# ---- With tools ------------------------------------------------------------------------------------------------------

LAYOUTS = (("--offsets", "direct"), ("--offsets", "indirect"), ("--codebook", "packed"))
BUILT_INS = ("sphere:33", "noise:23:1", "marschner-lobb:32", "membrane:60,41,13:7", "membrane:1,1,1:2", "sphere:1",
             "membrane:3,70,5:3")
SAMPLE_TYPES = (  # of a .raw file; voxel format, bits of a voxel
    ("u8", "DENSITY8", 8), ("i8", "DENSITY8", 8), ("u16", "DENSITY16", 16), ("i16", "DENSITY16", 16),
    ("i32", "DENSITY16", 32), ("f32", "FLOAT32", 32), ("bit", "BITMAP", 1))


@unittest.skipUnless(BIN, "VOXKIT_BIN is not set")
class Tools(ToolCase):
    def encode(self, source, *options):
        self.run_program(os.path.join(BIN, "vq-encode"), source, "-f", "-o", self.path("x.vqv"), *options)
        return self.path("x.vqv")

    def compare(self, file):
        info = json.loads(self.run_program(sys.executable, DECODER, "--info", file).stdout)
        tool, reference = self.decode_both(DECODER, file, "good.raw")
        reference = raw_file(reference, info["sample_type"])
        self.assertEqual(len(tool), len(reference))
        different = [at for at in range(len(tool)) if tool[at] != reference[at]]
        self.assertFalse(different, "{} bytes differ, the first at {}".format(len(different), different[:1]))
        said = json.loads(self.run_program(os.path.join(BIN, "vox-info"), file, "--json").stdout)
        for key in ("codewords", "unique_bricks", "mapping", "offset_bits", "offset_bytes", "codebook_bytes"):
            self.assertEqual(info[key], said[key])
        return info

    def test_built_ins(self):
        transforms = set()
        for source in BUILT_INS:
            for options in LAYOUTS + (("--max-error", "3"), ("--reduce", "3"), ("-k", "9", "--seeding", "d2"), ("--zstd", "3")):
                with self.subTest(source=source, options=options):
                    file = self.encode(source, *options)
                    info = self.compare(file)
                    if options[0] == "-k":
                        self.assertLessEqual(info["codewords"], 9)
                    if options[0] == "--codebook":
                        self.assertEqual(info["params"]["codebook"], "packed")
                    if options[0] == "--offsets":
                        self.assertEqual(info["mapping"], options[1])
                        shares = json.loads(self.run_program(os.path.join(BIN, "vq-encode"), source, "-f", "-o",
                                                             file, "--json").stdout)["transform_share"]
                        transforms |= {t for t, share in enumerate(shares) if share > 0}
        self.assertEqual(transforms, {0, 1, 2, 3})

    def test_sample_types(self):
        """A volume half zero, half noise, with runs."""
        for kind, voxel_format, bits in SAMPLE_TYPES:
            noise = random.Random(1)
            values = [noise.randrange(-1000, 1000) if at > 300 else 7 for at in range(13 * 9 * 6)]
            if kind == "f32":
                data = struct.pack("<702f", *(v / 8 for v in values))
            elif kind == "bit":
                data = bytes(noise.randrange(256) for _ in range(88))
            else:
                wrap = 1 << bits
                data = b"".join((v % wrap).to_bytes(bits // 8, "little") for v in values)
            write(self.path("in.raw"), data)
            for options in LAYOUTS + (("--max-error", "7"),):
                with self.subTest(type=kind, options=options):
                    file = self.encode(self.path("in.raw"), "--dims", "13,9,6", "--type", kind, *options)
                    self.assertEqual(self.compare(file)["voxel_format"], voxel_format)

    def test_damaged_files_are_refused(self):
        data = read(self.encode("membrane:20,20,9:1", "--offsets", "indirect"))
        damaged = [data[:length] for length in (0, 7, 64, 200, len(data) // 2, len(data) - 64, len(data) - 1)]
        for chunk in Container(data).chunks.values():
            for at in (chunk.offset, chunk.offset + chunk.length - 1):
                damaged.append(data[:at] + bytes((data[at] ^ 16,)) + data[at + 1:])
        for at in (0, 8, 10, 40, len(data) - 90, len(data) - 60, len(data) - 50, len(data) - 1):
            damaged.append(data[:at] + bytes((data[at] ^ 1,)) + data[at + 1:])
        for number, content in enumerate(damaged):
            with self.subTest(number=number):
                write(self.path("bad.vqv"), content)
                self.assertEqual(self.decode_both(DECODER, self.path("bad.vqv"), "bad.raw", expect=3), [None, None])


if __name__ == "__main__":
    unittest.main()
