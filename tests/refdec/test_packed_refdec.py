#!/usr/bin/env python3
"""Holds the reference decoder of layout packed against the tools: VOXKIT_BIN=build/bin python3 test_packed_refdec.py

Without VOXKIT_BIN only the tests that need no tool are run.
"""

import itertools
import json
import math
import os
import random
import struct
import sys
import unittest

sys.dont_write_bytecode = True
from container import Container, Refused  # noqa: E402
from helpers import BIN, HERE, container, raw_file, read, write  # noqa: E402
from packed_cases import BitWriter, Fields, PackedCase, few, smooth  # noqa: E402
from packed_decode import Packed, decode  # noqa: E402
from page_decode import Model, decode_page  # noqa: E402

DECODER = os.path.join(HERE, "packed_decode.py")


# ---- Without tools ---------------------------------------------------------------------------------------------------


class Models(unittest.TestCase):
    def refused(self, rule, **changes):
        with self.subTest(**changes), self.assertRaisesRegex(Refused, rule):
            Model(Fields(**changes).bytes())

    def test_rules(self):
        Model(Fields().bytes())
        self.refused("version", version=0)
        self.refused("version", version=5)
        self.refused("background", background=10)
        self.refused("bound", bound=2**31 - 1)
        self.refused("palette", palette=range(10))  # and a bound
        self.refused("entry", palette=[2**32 - 9 + i for i in range(10)], bound=0)
        self.refused("palette", palette=[0], most=1 << 18, bound=0)
        self.refused("first table", first_same=1)
        self.refused("table of 73", parts=[1] * 73)
        self.refused("adds up", parts=(1000, 500, 548))
        self.refused("adds up", parts=(1000, 500, 0))
        self.refused("behind its end", more=128)
        self.refused("behind its end", more=1 << 7 | 1)
        self.refused("class 17", weights={(17, 0): 32768})
        self.refused("class 4", weights={(4, 9): 32767, (4, 11): 3000})
        self.refused("class 4", weights={(4, 9): -28672})  # the rest tap's is one too many
        Model(Fields(weights={(4, 9): -28671}).bytes())
        Model(Fields(most=2**32 - 1, bound=2**31 - 2, background=2**32 - 1).bytes())
        # With parents the first voxel's class has taps, too, and all have the parent as the rest tap.
        Model(Fields(version=2, weights={(0, 29): 28, (47, 29): -28671}).bytes())
        self.refused("class 47", version=2, weights={(47, 29): -28672})
        self.refused("class 0", version=2, weights={(0, 16): 32767, (0, 18): 3000})
        with self.assertRaisesRegex(Refused, "33 bits"):
            Model(BitWriter().put(1, 8).put(0, 1).put(9, 32).put(1 << 33, 34).put(0, 64).bytes())

    def test_every_cut(self):
        for data, step in ((Fields(weights={(9, 14): 5, (2, 12): -7}).bytes(), 1), (Fields(version=2).bytes(), 7)):
            for length in range(0, len(data), step):
                with self.assertRaises(Refused):
                    Model(data[:length])

    def test_one_value(self):
        for most, size in ((255, 1), (256, 2), (65535, 2), (65536, 4)):
            model = Model(Fields(most=most).bytes())
            self.assertEqual(decode_page(model, b"", (2, 1, 1)), [5, 5])
            self.assertEqual(decode_page(model, most.to_bytes(size, "little"), (1, 2, 1)), [most] * 2)
            for page in [bytes(i) for i in range(1, size)] + ([(most + 1).to_bytes(size, "little")] if most == 256 else []):
                with self.assertRaises(Refused):
                    decode_page(model, page, (1, 1, 1))

    def test_rounding_and_mirrors(self):
        """One row of three: 5, 8, and one predicted as 8 (1 - w) + 5 w, with w = weight / 4096."""
        for weight, predicted, mirrored in ((0, 8, False),  # 8, as it is
                                            (2048, 6, True),  # 6.5, halves down
                                            (-2048, 9, True),  # 9.5
                                            (2047, 7, False),  # a little more than 6.5
                                            (2049, 6, True), (1, 8, False), (-1, 8, True)):
            fields = Fields(most=100, bound=0, weights={(2, 13): weight})
            for folded, distance in ((0, 0), (1, 1 if mirrored else -1), (2, -1 if mirrored else 1)):
                with self.subTest(weight=weight, folded=folded):
                    self.assertEqual(decode_page(Model(fields.bytes()), fields.page([0, 6, folded]), (3, 1, 1)),
                                     [5, 8, predicted + distance])

    def parents(self, shape, at, weights, folded, parents_shape=(4, 4, 4), **changes):
        """A page beside parents x + 4 y + 16 z, as numbers of its values."""
        fields = Fields(version=2, most=100, bound=0, weights=weights, **changes)
        samples = [x + 4 * y + 16 * z for z, y, x in itertools.product(*map(range, parents_shape[::-1]))]
        return decode_page(Model(fields.bytes()), fields.page(folded), shape, (samples, parents_shape, at))

    def test_parents_are_predictions(self):
        """No residuals: each voxel is its parent, or what is beside that."""
        for at in ((0, 0, 0), (1, 2, 1), (2, 2, 2)):
            parent = [sum(f * (a + i // 2) for f, a, i in zip((1, 4, 16), at, (x, y, z)))
                      for z, y, x in itertools.product(range(4), repeat=3)]
            self.assertEqual(self.parents((4, 4, 4), at, {}, [0] * 64), parent)
        for tap, toward in ((16, (-1, 0, 0)), (18, (1, 0, 0)), (20, (0, "y", 0)), (21, (1, "y", 0)), (23, (0, 0, "z")),
                            (25, (-1, "y", "z")), (26, (0, "y", "z")), (28, (0, "-y", 0)), (29, (0, 0, "-z"))):
            expected = []
            for z, y, x in itertools.product(range(4), repeat=3):
                sides = {"y": 1 if y % 2 else -1, "z": 1 if z % 2 else -1}
                step = [d if isinstance(d, int) else (-sides[d[1]] if d[0] == "-" else sides[d]) for d in toward]
                place = [min(max(1 + i // 2 + d, 0), 2 if n == 2 else 3) for n, i, d in zip(range(3), (x, y, z), step)]
                expected.append(place[0] + 4 * place[1] + 16 * place[2])
            with self.subTest(tap=tap):  # the page of parents ends before the last along z
                self.assertEqual(self.parents((4, 4, 4), (1, 1, 1), {(c, tap): 4096 for c in range(48)}, [0] * 64, (4, 4, 3)),
                                 expected)

    def test_classes_with_parents(self):
        """In each class another tap than the parent: that before it along x."""
        for shape, at, classes, step in (((5, 1, 1), (1, 1, 1), (0, 2, 1, 2, 3), 1), ((1, 5, 1), (1, 0, 1), (0, 8, 4, 8, 12), 4),
                                         ((1, 1, 5), (1, 1, 0), (0, 32, 16, 32, 16), 16)):
            first = at[0] + 4 * at[1] + 16 * at[2]
            for c in set(classes):
                with self.subTest(shape=shape, c=c):
                    self.assertEqual(self.parents(shape, at, {(c, 16): 4096}, [0] * 5),
                                     [first + i // 2 * step - (own == c) for i, own in enumerate(classes)])

    def test_parents_of_a_palette(self):
        """Parents are the entries that they are next to, of two the lower one."""
        model = Model(Fields(version=2, palette=(3, 7, 200), most=2, bound=0, background=1).bytes())
        self.assertEqual([model.nearest(s) for s in (0, 3, 5, 6, 7, 103, 104, 200, 2**32 - 1)], [0, 0, 0, 1, 1, 1, 2, 2, 2])
        model = Model(Fields(version=2, most=300, background=1).bytes())
        self.assertEqual([model.nearest(s) for s in (0, 300, 301, 2**32 - 1)], [0, 300, 300, 300])


class SmallFile(unittest.TestCase):
    """A DENSITY8 volume of 17 x 2 x 1 voxels: two pages, one of them the background, and a level of 9 x 1 x 1."""

    def setUp(self):
        self.voli = bytearray(struct.pack("<3QBB6x3d3d2d2d", 17, 2, 1, 3, 1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0))
        self.pakp = bytearray(struct.pack("<3B5x3d32x", 4, 2, 1, 0, 0, 1))
        self.fine, self.coarse = Fields(), Fields(bound=0, palette=(3, 7, 200), most=2, background=1)
        # In steps of 3, within 0 and 9. The second row is predicted from the first.
        self.folded = [2, 1, 1, 1, 1, 0, 2, 40, 0, 0, 3, 2, 2, 2, 0, 0] + [0, 0, 4, 2] + [0] * 12
        page = self.fine.page(self.folded)
        self.pages = bytearray((6, len(page), 0)) + page
        self.coarse_page = bytearray((1, 1, 2))

    def chunks(self):
        return [(b"VOLI", 0, 0, bytes(self.voli)), (b"PAKP", 0, 0, bytes(self.pakp)),
                (b"MODL", 1, 0, self.coarse.bytes()), (b"PAGE", 1, 0, bytes(self.coarse_page)),
                (b"MODL", 0, 0, self.fine.bytes()), (b"PAGE", 0, 0, bytes(self.pages))]

    def decode(self, data, level=0):
        return bytes(decode(Packed(Container(data)), level))

    def refused(self, data, rule):
        with self.assertRaisesRegex(Refused, rule):
            self.decode(data)
            self.decode(data, 1)

    def test_levels(self):
        data = container(self.chunks())
        row = [8, 5, 2, 0, 0, 0, 3, 9, 9, 9, 3, 6, 9, 9, 9, 9]
        self.assertEqual(list(self.decode(data)), row + [5] + row[:2] + [8, 3] + row[4:] + [5])
        self.assertEqual(self.decode(data, 1), bytes([200] * 9))
        self.coarse_page = bytearray((0,))
        self.assertEqual(self.decode(container(self.chunks()), 1), bytes([7] * 9))

    def test_any_order_and_unknown_kinds(self):
        chunks = [(b"NEWS", 7, 9, b"x" * 65)] + self.chunks()[::-1] + [(b"SVMP", 0, 0, b"")]
        self.assertEqual(self.decode(container(chunks)), self.decode(container(self.chunks())))

    def test_every_cut_and_a_flip_of_every_byte(self):
        data = container(self.chunks())
        for length in range(len(data)):
            self.refused(data[:length], ".")
        end = len(data)
        used = bytearray(b"\1" * 64 + bytes(end - 64 - 64 * 7) + b"\1" * 64 * 7)
        for chunk in Container(data).chunks.values():
            used[chunk.offset:chunk.offset + chunk.length] = b"\1" * chunk.length
        for at in range(len(data)):
            flipped = bytearray(data)
            flipped[at] ^= 1 << at * 5 % 8
            if used[at]:
                self.refused(bytes(flipped), ".")
            else:  # a gap
                self.assertEqual(self.decode(bytes(flipped)), self.decode(data))
        self.refused(data + bytes(64), "truncated")

    def test_chunk_rules(self):
        chunks = self.chunks()
        self.refused(container(chunks, codec=3), "codec 3")
        for gone in range(6):
            if chunks[gone][:2] != (b"MODL", 1):  # that of a finer level would do
                self.refused(container(chunks[:gone] + chunks[gone + 1:]), "expected exactly one|missing")
            self.refused(container(chunks + [chunks[gone]]), "twice")
        for more in ((b"PAKP", 1, 0), (b"PAGE", 0, 1), (b"PAGE", 2, 0), (b"MODL", 2, 0), (b"MODL", 0, 1)):
            self.refused(container(chunks + [(*more, b"\0")]), "expected exactly one|belong to no level")
        self.refused(container(chunks[:5] + [(b"PAGE", 0, 0, b"")]), "too many bits")
        for change in (b"\0", b"\1"):
            self.refused(container(chunks[:5] + [(b"PAGE", 0, 0, bytes(self.pages) + change)]), "add up")
        self.refused(container(chunks[:5] + [(b"PAGE", 0, 0, bytes(self.pages)[:-1])]), "add up")
        # A page with a byte more, in the length as well; it would be a word.
        page = self.fine.page(self.folded)
        for changed in (page[:1], page[:-1], page + b"\0", page[:5] + page, bytes((page[0] ^ 1,)) + page[1:]):
            self.refused(container(chunks[:5] + [(b"PAGE", 0, 0, bytes((6, len(changed), 0)) + changed)]),
                         "does not end|value")
        self.coarse_page = bytearray((1, 1, 3))
        self.refused(container(self.chunks()), "value 3 above 2")

    def test_cut(self):
        """Level 1 alone, with its own model, or with that of level 0, which is not there."""
        chunks = self.chunks()
        for kept in (chunks[:4], chunks[:5]):
            self.assertEqual(self.decode(container(kept), 1), bytes([200] * 9))
            with self.assertRaisesRegex(Refused, "was cut"):
                self.decode(container(kept))
        self.refused(container(chunks[:2] + chunks[3:4]), "MODL 1 is missing")

    def test_parents(self):
        """Level 1 is 3, 7, 200, …, 200, 3, and each voxel of level 0 as its parent; the second page's is the last."""
        self.fine = Fields(version=2, bound=0, most=200)
        self.coarse.parts = (700, 500, 500, 200)
        coarse_page = self.coarse.page([1, 2, 2, 0, 0, 0, 0, 0, 3])
        self.coarse_page = bytearray((6, len(coarse_page))) + coarse_page
        pages = [self.fine.page([0] * n) for n in (32, 2)]
        lengths = (len(pages[0]) | len(pages[1]) << 6).to_bytes(2, "little")
        self.pages = b"\6" + lengths + b"".join(pages)
        row = [3, 3, 7, 7] + [200] * 12 + [3]
        data = container(self.chunks())
        self.assertEqual(list(self.decode(data)), row * 2)
        self.assertEqual(list(self.decode(data, 1)), row[::2])
        good = self.coarse_page
        self.coarse_page = good[:-1] + bytes((good[-1] ^ 1,))
        with self.assertRaisesRegex(Refused, "level 1, page"):
            self.decode(container(self.chunks()))  # level 0
        self.coarse_page = good
        for chunks in (self.chunks()[:2] + self.chunks()[3:],
                       [(*key, self.fine.bytes() if key[0] == b"MODL" else data) for *key, data in self.chunks()]):
            self.refused(container(chunks), "level 1 has parents")
        self.pakp[1], self.voli[0] = 1, 16
        self.pages = b"\0"
        self.refused(container([c for c in self.chunks() if c[1] == 0]), "level 0 has parents")

    def test_field_rules(self):
        for chunk, layout, offset, value, rule in (
                ("voli", "<B", 24, 1, "codes 1 of RGBA32"), ("pakp", "<B", 0, 2, "pages of 2"), ("pakp", "<B", 0, 5, "pages of 2"),
                ("pakp", "<B", 0, 3, "levels, expected 1 or 3"), ("pakp", "<B", 1, 0, "levels"), ("pakp", "<B", 1, 3, "levels"),
                ("pakp", "<B", 1, 1, "belong to no level"), ("pakp", "<B", 2, 0, "codes"), ("pakp", "<B", 2, 2, "codes"),
                ("pakp", "<B", 2, 4, "codes"), ("pakp", "<B", 3, 1, "1 of DENSITY8"), ("pakp", "<B", 4, 1, "1 of DENSITY8"),
                ("pages", "<B", 0, 25, "too many bits"), ("pages", "<B", 0, 24, "add up"), ("pages", "<B", 1, 1, "add up")):
            self.setUp()
            struct.pack_into(layout, getattr(self, chunk), offset, value)
            with self.subTest(chunk=chunk, offset=offset, value=value):
                self.refused(container(self.chunks()), rule)
        self.setUp()
        self.fine.most = 256
        self.refused(container(self.chunks()), "samples up to 256")
        self.setUp()
        self.coarse.palette = (3, 7, 256)
        self.refused(container(self.chunks()), "samples up to 256")

    def floats(self, codes, lo, step, values):
        voli = struct.pack("<3QBB6x3d3d2d2d", 1, 1, 1, 5, 9, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0)
        out = []
        for value in values:
            model = Fields(most=2**32 - 1, bound=0, background=value)
            out.append(self.decode(container([
                (b"VOLI", 0, 0, voli), (b"PAKP", 0, 0, struct.pack("<3B5x3d32x", 3, 1, codes, lo, step, 0)),
                (b"MODL", 0, 0, model.bytes()), (b"PAGE", 0, 0, b"\0")])))
        return out

    def test_floats(self):
        bits = [0x80000000, 0xbf800000, 0x40800000, 2**32 - 1, 0]
        self.assertEqual(self.floats(2, 0, 0, bits), [struct.pack("<I", b) for b in (
            0, 0x3f800000, 0xbf7fffff, 0x7fffffff, 0xffffffff)])
        self.assertEqual(self.floats(3, -1.5, 0.25, [0, 1, 2, 3, 8]), [struct.pack("<I", b) for b in (
            0x7fc00000, 0xff800000, 0x7f800000)] + [struct.pack("<f", f) for f in (-1.5, -0.25)])
        self.assertEqual(self.floats(3, 0, 1e300, [4, 2**32 - 1]), [struct.pack("<I", 0x7f7fffff)] * 2)
        self.assertEqual(self.floats(3, -1e300, 1, [4]), [struct.pack("<I", 0xff7fffff)])
        for lo, step in ((math.nan, 1), (math.inf, 1), (0, 0), (0, -1), (0, math.nan), (0, math.inf)):
            with self.subTest(lo=lo, step=step), self.assertRaisesRegex(Refused, "steps"):
                self.floats(3, lo, step, [3])


# ---- With tools ------------------------------------------------------------------------------------------------------

LARGEST = (17, 5, 33)
DIMS = ((1, 1, 1), LARGEST, (1, 40, 2), (9, 8, 7))
SHAPES = ((16, "on"), (8, "on"), (8, "off"))


def constant(noise, dims, most):
    value = noise.randrange(most + 1)
    return (value for _ in range(dims[0] * dims[1] * dims[2]))


def as_raw(values, kind):
    if kind == "bit":
        return raw_file(bytes(values), "bit")
    if kind == "f32":
        return b"".join(struct.pack("<f", v / 4096 - 1) for v in values)
    size = int(kind[1:]) // 8
    return raw_file(b"".join(v.to_bytes(size, "little") for v in values), kind)


# Of a .raw file; the greatest number that is made of it, errors that are allowed.
KINDS = (("u8", 255, (0, 1, 7)), ("i8", 255, (0,)), ("u16", 65535, (0, 300)), ("i16", 4095, (0, 2)),
         ("f32", 20000, (0, 1e-3, 0.25)), ("bit", 1, (0,)))


@unittest.skipUnless(BIN, "VOXKIT_BIN is not set")
class Tools(PackedCase):
    def test_sample_types(self):
        noise = random.Random(1)
        seen = set()
        for (number, (kind, most, errors)), dims in itertools.product(enumerate(KINDS), DIMS):
            if dims == LARGEST:
                shapes = itertools.cycle(SHAPES[number % 3:] + SHAPES[:number % 3])
                cases = [(content, error, next(shapes)) for error in errors for content in (smooth, few)]
                cases += [(constant, 0, next(shapes))]
            else:
                cases = [((smooth, few)[(number + dims[0]) % 2], errors[-1], (8, "on"))] if kind in ("u8", "u16", "f32") else []
            for content, error, (side, levels) in cases:
                data = as_raw(list(content(noise, dims, most)), kind) if kind != "bit" or content is not smooth else as_raw(
                    [v > 500 for v in smooth(noise, dims, 1000)], kind)
                with self.subTest(kind=kind, dims=dims, content=content.__name__, error=error, page=side, levels=levels):
                    file = self.encode_raw(data, dims, kind, "--max-error", error, "--levels", levels, "--page", side)
                    packed, voxels = self.compare(file)
                    self.assertEqual(packed.side, side)
                    if error == 0:
                        self.assertEqual(voxels, data)
                    seen |= {(packed.codes, packed.models[0][0].wide, packed.models[0][0].has_palette, packed.models[0][0].bound > 0)}
                    # All levels but the coarsest have parents; the levels between have one model.
                    self.assertEqual([m[0].parents for m in packed.models], [True] * (packed.count - 1) + [False])
                    own = {index for kind_of_chunk, index, _ in packed.container.chunks if kind_of_chunk == b"MODL"}
                    self.assertEqual(own, {0, min(1, packed.count - 1), packed.count - 1})
        # Every way of a page was gone.
        self.assertLessEqual({(1, False, False, False), (1, False, False, True), (1, False, True, False),
                              (2, True, False, False), (2, False, True, False), (3, False, False, False)}, seen)

    def test_wide_numbers(self):
        """Floats of any bits, numbers that are none, steps above 2^16; integers of 32 bits by their names."""
        noise, dims = random.Random(2), (11, 9, 10)
        wild = [noise.choice((noise.randrange(2**32), 0x7f800000, 0xff800000, 0x7fc00000, 0x80000000, 0x3f800000))
                for _ in range(990)]
        _, voxels = self.compare(self.encode_raw(struct.pack("<990I", *wild), dims, "f32", "--page", 8))
        self.assertEqual(voxels, struct.pack("<990I", *wild))
        waves = [1000 * v + noise.random() for v in smooth(noise, dims, 20000)]
        waves[5:8] = math.nan, math.inf, -math.inf
        packed, _ = self.compare(self.encode_raw(struct.pack("<990f", *waves), dims, "f32", "--max-error", 4))
        self.assertEqual((packed.codes, packed.models[0][0].wide), (3, True))
        names = [noise.choice((7, 4000000000, 65536, 12)) for _ in range(990)]
        packed, voxels = self.compare(self.encode_raw(struct.pack("<990I", *names), dims, "u32", "--labels"))
        self.assertEqual(voxels, struct.pack("<990I", *names))

    def test_labels(self):
        """Names, in patches; with and without levels, pages of both sides, few names and many."""
        noise, dims = random.Random(5), (21, 18, 19)
        points = [(noise.randrange(21), noise.randrange(18), noise.randrange(19)) for _ in range(40)]

        def nearest(x, y, z):
            return min(range(40), key=lambda n: sum((a - b) ** 2 for a, b in zip(points[n], (x, y, z))))

        patches = [nearest(x, y, z) for z in range(19) for y in range(18) for x in range(21)]
        for name_of, kind, width in ((lambda n: 3 * n, "u8", "B"), (lambda n: 65000 - 900 * n, "u16", "H"),
                                     (lambda n: n * 2654435761 % 2**32, "u32", "I")):
            data = struct.pack("<{}{}".format(len(patches), width), *map(name_of, patches))
            for options in ((), ("--levels", "off"), ("--page", 8)):
                packed, voxels = self.compare(self.encode_raw(data, dims, kind, "--labels", *options))
                self.assertEqual(voxels, data)
                self.assertTrue(packed.models[0][0].labels)

    def test_several_parts(self):
        """More pages than a part has, as NRRD, with a value for nothing measured."""
        dims, noise = (82, 82, 66), random.Random(3)
        row = bytes(noise.randrange(9) for _ in range(82))
        voxels = bytes(82 * 82 * 40) + row * 82 + bytes((4,)) * 82 * 82 * 24 + row * 82
        write(self.path("in.nrrd"), b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 82 82 66\nencoding: raw\nendian: little\n\n" + voxels)
        packed, decoded = self.compare(self.encode(self.path("in.nrrd"), "--page", 8, "--fill", 4))
        self.assertEqual(decoded, voxels)
        self.assertIn((b"PAGE", 0, 1), packed.container.chunks)

    def test_cut(self):
        """Files that end where a level does."""
        data = as_raw(list(smooth(random.Random(4), (40, 9, 17), 255)), "u8")
        file = read(self.encode_raw(data, (40, 9, 17), "u8", "--page", 8))
        at = {(kind, level): chunk.offset for (kind, level, _), chunk in Container(file).chunks.items()}
        # What comes behind levels 3, 2 and 1.
        for level, behind in ((3, (b"MODL", 1)), (2, (b"PAGE", 1)), (1, (b"MODL", 0))):
            write(self.path("cut.svmm"), file[:at[behind]])
            packed, _ = self.compare(self.path("cut.svmm"))
            self.assertEqual((packed.finest, packed.count), (level, 4))

    def test_built_ins_and_the_program(self):
        for source, options in (("marschner-lobb:19", ()), ("noise:17:2", ("--page", "8")), ("sphere:21", ("--levels", "off")),
                                ("membrane:37,5,20:8", ("--max-error", "3"))):
            with self.subTest(source=source):
                file = self.encode(source, *options)
                self.compare(file)
                if source.startswith("sphere") or source.startswith("noise"):
                    continue
                info = json.loads(self.run_program(sys.executable, DECODER, "--info", file).stdout)
                said = json.loads(self.run_program(os.path.join(BIN, "vox-info"), file, "--json").stdout)
                for key in ("dims", "voxel_format", "sample_type"):
                    self.assertEqual(info[key], said[key])
                last = len(info["levels"]) - 1
                tool, reference = self.decode_both(DECODER, file, "good.raw", "--level", last)
                self.assertEqual(tool, raw_file(reference, info["sample_type"]))
                self.decode_both(DECODER, file, "none.raw", "--level", last + 1, expect=2)

    def test_damaged_files_are_refused(self):
        data = read(self.encode("membrane:20,9,5:3"))
        damaged = [data[:length] for length in (0, 7, 64, 200, len(data) // 2, len(data) - 64, len(data) - 1)]
        for chunk in Container(data).chunks.values():
            for at in (chunk.offset, chunk.offset + chunk.length - 1):
                damaged.append(data[:at] + bytes((data[at] ^ 16,)) + data[at + 1:])
        for at in (0, 8, 10, 40, len(data) - 90, len(data) - 60, len(data) - 50, len(data) - 1):
            damaged.append(data[:at] + bytes((data[at] ^ 1,)) + data[at + 1:])
        for number, content in enumerate(damaged):
            with self.subTest(number=number):
                write(self.path("bad.svmm"), content)
                if number % 8 == 0:
                    self.assertEqual(self.decode_both(DECODER, self.path("bad.svmm"), "bad.raw", expect=3), [None, None])
                    continue
                self.run_program(os.path.join(BIN, "vox-decode"), self.path("bad.svmm"), "-o", self.path("tool.raw"), expect=3)
                with self.assertRaises(Refused):
                    decode(Packed(Container(content)), 0)

    def test_damage_with_right_checksums(self):
        """Both refuse it, or both make the same of it."""
        noise, dims = random.Random(4), (11, 9, 10)
        refused = same = 0
        for kind, content, most, error in (("u8", smooth, 255, 0), ("u8", smooth, 255, 2), ("u16", few, 65535, 0),
                                           ("f32", smooth, 20000, 0), ("f32", smooth, 20000, 0.01)):
            values = list(content(noise, dims, most))
            data = as_raw([v + noise.random() for v in values] if kind == "f32" else values, kind)
            with self.subTest(kind=kind, error=error):
                file = self.encode_raw(data, dims, kind, "--max-error", error, "--page", 8)
                counts_of = self.damage(file, noise, (b"PAKP", b"MODL", b"PAGE"), 25)
                refused, same = refused + counts_of[0], same + counts_of[1]
        self.assertGreater(min(refused, same), 10)


if __name__ == "__main__":
    unittest.main()
