#!/usr/bin/env python3
"""Holds the reference decoder of coloured surfaces against the tools: VOXKIT_BIN=build/bin python3 test_dag_refdec.py

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
from helpers import BIN, HERE, ToolCase, container, read, write  # noqa: E402
from attribute_decode import direction  # noqa: E402
from dag_decode import Surface, decode  # noqa: E402

DECODER = os.path.join(HERE, "dag_decode.py")


# ---- Without tools ---------------------------------------------------------------------------------------------------


class SmallFile(unittest.TestCase):
    """8 x 4 x 4 voxels: the first and the last one, and the eight of the octant at (4, 0, 0)."""

    def setUp(self):
        self.voli = struct.pack("<3QBB6x3d3d2d2d", 8, 4, 4, 1, 1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0)
        self.dagp = bytearray(struct.pack("<7BxQQI4x2d5Q40x", 3, 1, 1, 1, 3, 0, 1, 10, 10, 0, 9.56, 0, 0, 0, 0, 0, 0))
        self.leaf = bytearray(struct.pack("<2Q", 1, 0xFF | 1 << 63))
        self.node = bytearray(struct.pack("<3I", 0b11 | 10 << 8, 0, 1))
        # One colour, eight with 1 bit each, one colour.
        self.colr = bytearray(struct.pack("<II", 3, 0) + struct.pack("<QQ", 0, 0) +
                              struct.pack("<II", 0 | 65535 << 16, 1023 | 2047 << 10) +
                              struct.pack("<IHH", 1 | 0 << 14 | 0 << 16, 0, 0xFFFF) +
                              struct.pack("<II", 9 | 65535 << 16, 1023 << 22) + bytes((0b10000001,)) + bytes(8))

    def file(self):
        return container([(b"VOLI", 0, 0, self.voli), (b"DAGP", 0, 0, bytes(self.dagp)), (b"LEAF", 0, 0, bytes(self.leaf)),
                          (b"NODE", 3, 0, bytes(self.node)), (b"COLR", 0, 0, bytes(self.colr))], codec=3)

    def test_decodes(self):
        out = decode(Surface(Container(self.file())))
        voxel = lambda x, y, z: tuple(out[4 * ((z * 4 + y) * 8 + x):][:4])
        self.assertEqual(voxel(0, 0, 0), (255, 127, 0, 255))
        self.assertEqual(voxel(4, 0, 0), (255, 255, 255, 255))
        self.assertEqual(voxel(5, 0, 0), (0, 0, 0, 255))
        self.assertEqual(voxel(5, 1, 1), (255, 255, 255, 255))
        self.assertEqual(voxel(7, 3, 3), (0, 0, 255, 255))
        self.assertEqual(sum(1 for at in range(3, len(out), 4) if out[at]), 10)

    def with_attributes(self, **changed):
        """The same with an opacity, two normals and two ids."""
        chunks = dict(opacity=bytes((3, 3)) + bytes(62), opacities=struct.pack("<II", 1, 0) + struct.pack("<QQ", 0, 0) +
                      struct.pack("<IBB", 65535 << 16, 77, 9) + bytes(2) + bytes(8),
                      normal=bytes((1,)) + bytes(63), normals=bytes((128, 255)),
                      id=bytes((7,)) + bytes(63), ids=struct.pack("<III", 2, 5, 1 << 30) + struct.pack("<IIII", 1, 0, 0, 0) +
                      (15 << 14).to_bytes(7, "little") + bytes((2, 2)) + bytes(8))
        chunks.update(changed)
        self.dagp[92] = chunks.get("there", 1 << 1 | 1 << 2 | 1 << 4)
        more = [(b"ATTP", 1, 0, chunks["opacity"]), (b"ATTR", 1, 0, chunks["opacities"]), (b"ATTP", 2, 0, chunks["normal"]),
                (b"ATTR", 2, 0, chunks["normals"]), (b"ATTP", 4, 0, chunks["id"]), (b"ATTR", 4, 0, chunks["ids"])]
        return container([(b"VOLI", 0, 0, self.voli), (b"DAGP", 0, 0, bytes(self.dagp)), (b"LEAF", 0, 0, bytes(self.leaf)),
                          (b"NODE", 3, 0, bytes(self.node)), (b"COLR", 0, 0, bytes(self.colr)), *more], codec=3)

    def test_attributes(self):
        surface = Surface(Container(self.with_attributes()))
        self.assertEqual(list(surface.attributes), ["opacity", "normal", "id"])
        self.assertEqual(surface.attributes["opacity"], [bytes((77,))] * 10)
        self.assertEqual(direction(surface.attributes["normal"][3]), (0, 1, 0))
        self.assertEqual([struct.unpack("<I", i)[0] for i in surface.attributes["id"]], [5 if i not in (1, 9) else 1 << 30 for i in range(10)])
        self.assertEqual(decode(surface)[3], 77)

    def test_broken_attributes(self):
        for changed in (dict(there=1 << 1), dict(there=31), dict(opacity=bytes((1, 1)) + bytes(62)), dict(opacity=bytes((3, 2)) + bytes(62)),
                        dict(opacity=bytes((3, 3)) + bytes(61)), dict(normals=bytes(3)), dict(id=bytes((3,)) + bytes(63)),
                        dict(ids=struct.pack("<III", 2, 5, 5) + bytes(33)), dict(ids=struct.pack("<II", 65537, 5) + bytes(33)),
                        dict(ids=bytes(40))):
            self.setUp()
            with self.assertRaises(Refused, msg=str(changed)):
                Surface(Container(self.with_attributes(**changed)))

    def test_broken_rules(self):
        for chunk, layout, offset, value in (
                ("dagp", "<B", 0, 5), ("dagp", "<B", 0, 6), ("dagp", "<B", 0, 8), ("dagp", "<B", 1, 3), ("dagp", "<B", 2, 0), ("dagp", "<B", 3, 3),
                ("dagp", "<B", 4, 4), ("dagp", "<B", 6, 3), ("dagp", "<Q", 8, 11), ("dagp", "<Q", 16, 11),
                ("dagp", "<Q", 8, 9), ("dagp", "<I", 24, 3), ("node", "<I", 4, 2), ("node", "<I", 0, 0b111),
                ("colr", "<I", 0, 4), ("colr", "<Q", 8, 1), ("colr", "<Q", 16, 1), ("colr", "<I", 32, 0),
                ("colr", "<I", 32, 1 | 1 << 16)):
            self.setUp()
            struct.pack_into(layout, getattr(self, chunk), offset, value)
            with self.subTest(chunk=chunk, offset=offset, value=value), self.assertRaises(Refused):
                decode(Surface(Container(self.file())))
        self.setUp()
        self.leaf.clear()
        with self.assertRaisesRegex(Refused, "LEAF"):
            decode(Surface(Container(self.file())))


# ---- With tools ------------------------------------------------------------------------------------------------------


class SurfaceCase(ToolCase):
    """Compresses, and compares what both decoders make of it."""

    def encode(self, source, *options):
        self.run_program(os.path.join(BIN, "dagcolor-pack"), source, "-f", "-o", self.path("x.dagc"), *options)
        return self.path("x.dagc")

    def compare(self, file):
        tool, reference = self.decode_both(DECODER, file, "good.raw")
        self.assertEqual(len(tool), len(reference))
        different = [at for at in range(len(tool)) if tool[at] != reference[at]]
        self.assertFalse(different, "{} bytes differ, the first at {}".format(len(different), different[:1]))
        said = json.loads(self.run_program(os.path.join(BIN, "vox-info"), file, "--json").stdout)
        info = json.loads(self.run_program(sys.executable, DECODER, "--info", file).stdout)
        for key in ("dims", "leaf_voxels", "color_count"):
            self.assertEqual(info[key], said[key])
        return info


@unittest.skipUnless(BIN, "VOXKIT_BIN is not set")
class Tools(SurfaceCase):
    def test_built_ins(self):
        for options in (("--codec", "raw"), ("--codec", "fws"), ("--codec", "vws"), ("--codec", "bc1"),
                        ("--codec", "palette"), ("--codec", "palette", "--palette", "3", "--colors", "all"),
                        ("--codec", "bc1", "--image-curve", "hilbert", "--colors", "all"),
                        ("--codec", "png"), ("--codec", "png", "--palette", "5", "--image-curve", "hilbert"), ("--codec", "png", "--palette", "200"), ("-e", "2"),
                        ("--codec", "raw", "--zstd", "3"),
                        ("--codec", "predicted"), ("--codec", "predicted", "-e", "0"),
                        ("--codec", "predicted", "-e", "30", "--geometry", "octree"),
                        ("-e", "4", "--space", "lab"), ("-e", "25.5", "--effort", "1"),
                        ("--colors", "all"), ("--counts", "pointer"), ("--colors", "all", "--counts", "pointer"),
                        ("--geometry", "dag"), ("--geometry", "dag", "--colors", "all", "--curve", "hilbert"),
                        ("--curve", "hilbert"), ("--curve", "hilbert", "--counts", "pointer", "--colors", "all")):
            with self.subTest(options=options):
                self.compare(self.encode("menger:3", *options))

    def test_volumes(self):
        """Few voxels, many, noise in a macro block of its own."""
        noise = random.Random(1)
        for dims, share in (((1, 1, 1), 1.0), ((70, 3, 9), 0.1), ((40, 40, 40), 0.9)):
            data = bytearray()
            for _ in range(dims[0] * dims[1] * dims[2]):
                data += bytes((noise.randrange(256), noise.randrange(256), noise.randrange(256), 255)
                              if noise.random() < share else 4)
            write(self.path("in.raw"), data)
            for options in ((), ("-e", "1"), ("--simplify", "2"), ("--colors", "all"), ("--codec", "bc1"), ("--codec", "palette"), ("--codec", "png"),
                            ("--codec", "palette", "--palette", "65536"), ("--codec", "predicted"),
                            ("--curve", "hilbert", "--colors", "all")):
                with self.subTest(dims=dims, options=options):
                    self.compare(self.encode(self.path("in.raw"), "--dims", "%d,%d,%d" % dims, "--type", "rgba8", *options))

    def test_attributes(self):
        """Points with properties; what vox-decode writes as such again."""
        noise = random.Random(2)
        kinds = ("float x", "float y", "float z", "uchar red", "uchar green", "uchar blue", "uchar alpha", "float nx", "float ny",
                 "float nz", "uchar roughness", "uchar metallic", "uint label")
        for steps in (1, 9, 256):  # values that are all equal, that come again, and noise
            lines = []
            for _ in range(700):
                value = lambda most: noise.randrange(steps) * most // max(steps - 1, 1)
                lines.append(" ".join(map(str, [noise.randrange(40), noise.randrange(40), noise.randrange(9), value(255), value(255),
                                                7, 1 + value(254), value(9) - 4, value(9) - 4, value(9) - 5, value(255), value(255),
                                                value(4 * 10 ** 9)])))
            write(self.path("in.ply"), "\n".join(["ply", "format ascii 1.0", "element vertex 700", *("property " + k for k in kinds),
                                                  "end_header", *lines, ""]).encode())
            for options in (("--codec", "raw"), ("--codec", "fws", "--weight-bits", "2"), (), ("--colors", "all", "--curve", "hilbert"),
                            ("--attribute-threshold", "opacity=0,normal=0,rm=0", "--zstd", "3")):
                with self.subTest(steps=steps, options=options):
                    file = self.encode(self.path("in.ply"), "--resolution", "40", "--attributes", "color,opacity,normal,rm,id", *options)
                    self.compare(file)
                    self.run_program(os.path.join(BIN, "vox-decode"), file, "-f", "-o", self.path("out.ply"))
                    data = read(self.path("out.ply"))
                    points = list(struct.iter_unpack("<3f4B3f2BI", data[data.index(b"end_header\n") + 11:]))
                    surface = Surface(Container(read(file)))
                    code = lambda at: sum((at[a] >> i & 1) << 3 * i + a for i in range(6) for a in range(3))
                    voxels = sorted(surface.walk(), key=lambda v: code(v[:3]))
                    self.assertEqual(len(points), len(voxels))
                    for point, (_, _, _, number) in zip(points, voxels):
                        values = {name: all_of[number] for name, all_of in surface.attributes.items()}
                        self.assertEqual(bytes(point[3:6]), bytes(surface.colors[number]))
                        self.assertEqual((point[6:7], point[10:12]), (tuple(values["opacity"]), tuple(values["rm"])))
                        self.assertEqual(point[12], struct.unpack("<I", values["id"])[0])
                        for is_, was in zip(point[7:10], direction(values["normal"])):
                            self.assertAlmostEqual(is_, was, places=6)

    def test_what_it_cannot_read_it_refuses(self):
        for codec in ("bc7", "jpeg", "jp2"):
            with self.subTest(codec=codec):
                done = self.run_program(sys.executable, DECODER, self.encode("menger:2", "--codec", codec), self.path("x.raw"), expect=3)
                self.assertIn(codec + " is not supported", done.stderr)

    def test_damaged_files_are_refused(self):
        data = read(self.encode("menger:2"))
        damaged = [data[:length] for length in (0, 7, 64, 200, len(data) // 2, len(data) - 64, len(data) - 1)]
        for chunk in Container(data).chunks.values():
            for at in {chunk.offset, chunk.offset + chunk.length - 1} if chunk.length else ():
                damaged.append(data[:at] + bytes((data[at] ^ 16,)) + data[at + 1:])
        for number, content in enumerate(damaged):
            with self.subTest(number=number):
                write(self.path("bad.dagc"), content)
                self.assertEqual(self.decode_both(DECODER, self.path("bad.dagc"), "bad.raw", expect=3), [None, None])


if __name__ == "__main__":
    unittest.main()
