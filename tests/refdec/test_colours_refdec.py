#!/usr/bin/env python3
"""Colours of layout packed, the reference decoder against the tools: VOXKIT_BIN=build/bin python3 test_colours_refdec.py

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
from helpers import BIN, HERE, container, write  # noqa: E402
from mask_decode import MaskModel, decode_mask  # noqa: E402
from packed_cases import BitWriter, Fields, MaskFields, PackedCase  # noqa: E402
from packed_decode import MASK, Packed, decode  # noqa: E402
from page_decode import Model, decode_page  # noqa: E402

DECODER = os.path.join(HERE, "packed_decode.py")
CHANNELS = {"rgba8": 4, "rgb8": 3}


# ---- Without tools ---------------------------------------------------------------------------------------------------


class Masks(unittest.TestCase):
    def test_model(self):
        model = MaskModel(MaskFields(numbers={0: 1, 1: 31, 5000: 16, 8191: 7}).bytes())
        self.assertEqual({c: q for c, q in enumerate(model.solid) if q != 1024}, {0: 1, 1: 2047, 5000: 700, 8191: 32})
        self.assertFalse(model.parents)
        self.assertTrue(MaskModel(MaskFields(2).bytes()).parents)
        start = BitWriter().put(1, 8).golomb(8190, 2).put(9, 5).bits
        for more, rule in (
                (lambda out: out.golomb(1, 2), None), (lambda out: out.golomb(0, 2).put(31, 5), None),
                (lambda out: out.golomb(0, 2).put(0, 5), "is 0"), (lambda out: out.golomb(2, 2), "more than 8192"),
                (lambda out: out.golomb(2**32 - 1, 2), "more than 8192"), (lambda out: out.put(0, 5), "cut off"),
                (lambda out: out.put(1 << 30, 31).put(4, 32), "number"), (lambda out: out.put(1 << 31, 32), "33 bits"),
                (lambda out: out.golomb(1, 2).put(0, 8), "behind its end"),
                (lambda out: out.golomb(1, 2).put(255, 8), "behind its end")):
            out = BitWriter()
            out.bits = list(start)
            data = more(out).bytes()
            with self.subTest(rule=rule, data=data):
                if rule is None:
                    MaskModel(data)
                    continue
                with self.assertRaisesRegex(Refused, rule):
                    MaskModel(data)
        for version in (0, 3):
            with self.assertRaisesRegex(Refused, "version"):
                MaskModel(MaskFields(version).bytes())

    def coded(self, shape, expected, parents=None):
        """All of a page is solid, but for voxels of which `expected` has no context; the others have these. As the state
        is 1, it stays so."""
        asked = []

        class Asked:
            def __getitem__(self, context):
                asked.append(context)
                return 2 + context % 2046

        model = MaskModel(MaskFields(2 if parents else 1).bytes())
        model.solid = Asked()
        self.assertEqual(decode_mask(model, b"\1\0", shape, parents), [c is not None for c in expected])
        self.assertEqual(asked, [c for c in expected if c is not None])

    def test_contexts_alone(self):
        self.coded((4, 1, 1), (0, 1, 3, 3))
        self.coded((1, 4, 1), (0, 8, 8 + 256, 8 + 256))
        self.coded((1, 1, 4), (0, 64 + 4096, 64 + 2048 + 4096, 64 + 2048 + 4096))
        self.coded((2, 2, 2), (0, 1, 8 + 16, 1 + 4 + 8, 64 + 128 + 1024 + 4096, 1 + 32 + 64 + 1024 + 4096,
                               8 + 16 + 64 + 128 + 512 + 4096, 1 + 4 + 8 + 32 + 64 + 512 + 4096))

    def test_contexts_with_parents(self):
        own = (0, 1, 4 + 8, 1 + 2 + 4, 32, 1 + 16 + 32, 4 + 8 + 32 + 64, 1 + 2 + 4 + 16 + 32 + 64)
        for sides in itertools.product((0, 1), repeat=3):
            # A page of 3 x 3 x 3 parents, of which one voxel is that of the page; of those beside it three are solid.
            for at in itertools.product((0, 1, 2), repeat=3):
                around = [at] + [tuple(c + (2 * side - 1) * (a == axis) for a, c in enumerate(at))
                                 for axis, side in enumerate(sides)]
                solid = [(x, y, z) in around for z, y, x in itertools.product(range(3), repeat=3)]
                expected = []
                for i, (z, y, x) in enumerate(itertools.product((0, 1), repeat=3)):
                    context = own[i] + 1024 * i
                    for axis, child in enumerate((x, y, z)):
                        if child == sides[axis] and 0 <= at[axis] + 2 * child - 1 <= 2:
                            context += 128 << axis
                    expected.append(context)
                self.coded((2, 2, 2), expected, (solid, (3, 3, 3), at))
        # Children of void voxels are not coded, and void to those beside them.
        self.coded((4, 1, 1), (None, None, 0, 1 + 1024), ([False, True], (2, 1, 1), (0, 0, 0)))
        self.coded((4, 1, 1), (0, 1 + 1024, None, None), ([True, False], (2, 1, 1), (0, 0, 0)))

    def test_pages_of_a_byte_or_none(self):
        alone, beside = MaskModel(MaskFields().bytes()), MaskModel(MaskFields(2).bytes())
        parents = [True, False, False, True, True], (5, 1, 1), (1, 0, 0)
        self.assertEqual(decode_mask(alone, b"", (3, 1, 1)), [False] * 3)
        self.assertEqual(decode_mask(alone, b"\1", (3, 1, 1)), [True] * 3)
        self.assertEqual(decode_mask(beside, b"", (7, 1, 1), parents), [False] * 7)
        self.assertEqual(decode_mask(beside, b"\1", (7, 1, 1), parents), [False] * 4 + [True] * 3)
        for page in (b"\0", b"\2", b"\0\0", b"\2\0", b"\x80" * 9):
            with self.subTest(page=page), self.assertRaises(Refused):
                decode_mask(alone, page, (3, 1, 1))
        self.assertEqual(decode_mask(beside, b"\1\0", (4, 1, 1), parents), [False] * 4)  # nothing to decode

    def test_long(self):
        """Of words, and both ways of every part."""
        noise = random.Random(1)
        numbers = {0: 31, 1: 5, 2: 20, 3: 28}
        fields, solid, context, mask = MaskFields(numbers=numbers), [], 0, []
        for _ in range(300):
            mask.append(noise.random() < 0.6)
            solid.append((context, mask[-1]))
            context = (2 * context + mask[-1]) & 3
        # Of bits 0 and 1, the first is the nearer voxel.
        self.assertEqual(decode_mask(MaskModel(fields.bytes()), fields.page(solid), (300, 1, 1)), mask)
        page = fields.page(solid)
        for changed in (page + b"\0", page[:-1], b"\0" + page[1:]):
            with self.assertRaises(Refused):
                decode_mask(MaskModel(fields.bytes()), changed, (300, 1, 1))

    def test_void_voxels(self):
        """Nothing is taken for them, their value is the prediction, and their magnitude 0."""
        fields = Fields(most=100, bound=0, background=50)
        mask = [True, False, True, True, False, False]
        # 50 + 3, as it, as that − 2, …
        model = Model(fields.bytes())
        self.assertEqual(decode_page(model, fields.page([6, 3, 2]), (3, 2, 1), None, mask), [53, 53, 51, 54, 53, 51])
        mask = [False, False, True]
        self.assertEqual(decode_page(model, fields.page([4]), (3, 1, 1), None, mask), [50, 50, 52])
        self.assertEqual(decode_page(model, b"\7", (3, 1, 1), None, mask), [7] * 3)
        self.assertEqual(decode_page(model, b"\1\0", (3, 1, 1), None, [False] * 3), [50] * 3)
        with self.assertRaisesRegex(Refused, "wide"):
            decode_page(Model(Fields(most=65536).bytes()), b"\1" + bytes(4), (1, 1, 1), None, [False])


class SmallFile(unittest.TestCase):
    """A volume of 17 x 1 x 1 colours in two pages, of which the second is void, and a level of 9 x 1 x 1."""

    def setUp(self):
        self.voxel_format, self.pakp = 1, bytearray(struct.pack("<5B3x3d32x", 4, 2, 4, 0, 1, 0, 0, 0))
        self.coarse = [Fields(most=most, bound=0, background=value)
                       for most, value in ((255, 100), (510, 265), (510, 10), (255, 9))]
        self.fine = [Fields(most=f.most, bound=0, background=f.background, version=2) for f in self.coarse]
        self.coarse_mask, self.fine_mask = MaskFields(), MaskFields(2)
        solid = [(0, True)] + [(1, False), (2, True)] * 3 + [(1, False), (2, False)]
        self.coarse_masks, self.coarse_pages = [self.coarse_mask.page(solid)], [b""] * 4
        self.masks, self.pages = [b"\1", b""], [b"\300", b"", b"", self.fine[3].page([0, 2] + [0] * 6)] + [b""] * 4

    @staticmethod
    def part(pages):
        lengths = sum(len(page) << 11 * i for i, page in enumerate(pages))
        return b"\13" + lengths.to_bytes((11 * len(pages) + 7) // 8, "little") + b"".join(pages)

    def chunks(self):
        channels = 4 if self.voxel_format == 1 else 3
        voli = struct.pack("<3QBB6x3d3d2d2d", 17, 1, 1, self.voxel_format, 1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0)
        out = [(b"VOLI", 0, 0, voli), (b"PAKP", 0, 0, bytes(self.pakp))]
        for level, mask, models in ((1, self.coarse_mask, self.coarse), (0, self.fine_mask, self.fine)):
            out.append((b"MMOD", level, 0, mask.bytes()))
            out += [(b"MODL", level, c, models[c].bytes()) for c in range(channels)]
        for level, masks, pages in ((1, self.coarse_masks, self.coarse_pages), (0, self.masks, self.pages)):
            pages = [page for i, page in enumerate(pages) if i % 4 < channels]
            out += [(b"MASK", level, 0, self.part(masks)), (b"PAGE", level, 0, self.part(pages))]
        return out

    def decode(self, chunks, level=0, strict=True):
        voxels = bytes(decode(Packed(Container(container(chunks)), strict), level))
        size = 4 if self.voxel_format == 1 else 3
        return [tuple(voxels[i:i + size]) for i in range(0, len(voxels), size)]

    def refused(self, chunks, rule, strict=True):
        with self.assertRaisesRegex(Refused, rule):
            self.decode(chunks, 0, strict)

    def test_levels(self):
        """R = 265 − 255 + G and B = 10 − 255 + G, brought into 0 to 255."""
        void, coarse = (0,) * 4, (110, 100, 0, 9)
        self.assertEqual(self.decode(self.chunks(), 1), [coarse, void] * 4 + [void])
        # G is 192, the others are as in level 1, but for a little more alpha of the second voxel.
        fine = (202, 192, 0)
        self.assertEqual(self.decode(self.chunks()), [fine + (9,), fine + (10,), void, void] +
                         ([fine + (9,)] * 2 + [void] * 2) * 3 + [void])
        self.pakp[4] = 0
        for fields in self.coarse[1:3] + self.fine[1:3]:
            fields.most, fields.background = 255, 7 * (fields.version == 1)
        self.pages[1:3] = b"\5", b"\6"
        self.assertEqual(self.decode(self.chunks(), 1)[0], (7, 100, 7, 9))
        self.assertEqual(self.decode(self.chunks())[:3], [(5, 192, 6, 9), (5, 192, 6, 10), void])
        self.voxel_format = 2
        self.assertEqual(self.decode(self.chunks())[:3], [(5, 192, 6)] * 2 + [void[:3]])
        self.assertEqual(self.decode(self.chunks())[16], void[:3])

    def test_field_rules(self):
        for at, value, voxel_format, rule in (
                (2, 1, 1, "codes"), (2, 6, 1, "codes"), (2, 5, 1, "1 of RGBA32"), (2, 3, 2, "codes"), (3, 2, 1, "2 of RGBA32"),
                (3, 1, 2, "1 of RGB24"), (4, 2, 1, "2 of RGBA32")):
            self.setUp()
            self.pakp[at], self.voxel_format = value, voxel_format
            with self.subTest(at=at, value=value, voxel_format=voxel_format):
                self.refused(self.chunks(), rule)
        self.setUp()
        good = self.decode(self.chunks())
        self.pakp[3] = 1  # which is not so
        self.assertEqual(self.decode(self.chunks()), good)
        for channel, most, differences in (
                (0, 256, 1), (3, 256, 1), (1, 511, 1), (2, 511, 1), (1, 256, 0), (2, 510, 0)):
            self.setUp()
            self.pakp[4] = differences
            if not differences:
                for fields in self.coarse + self.fine:
                    fields.most, fields.background = min(fields.most, 255), min(fields.background, 255)
            self.fine[channel].most = most
            with self.subTest(channel=channel, most=most, differences=differences):
                self.refused(self.chunks(), r"MODL 0.{}: samples up to {}".format(channel, most))
        for one in range(5):
            self.setUp()
            (self.fine + [self.fine_mask])[one].version = 1
            self.refused(self.chunks(), "only some of its models have parents")
        self.setUp()
        for fields in self.coarse + [self.coarse_mask]:
            fields.version = 2
        self.refused(self.chunks(), "level 1 has parents")

    def test_chunk_rules(self):
        chunks = self.chunks()
        for gone in range(1, len(chunks)):
            with self.subTest(gone=chunks[gone][:3]):
                self.refused(chunks[:gone] + chunks[gone + 1:], "expected exactly one|missing")
        for more in ((b"MMOD", 0, 1), (b"MMOD", 2, 0), (b"MODL", 0, 4), (b"MODL", 2, 1), (b"MASK", 0, 1),
                     (b"MASK", 2, 0)):
            with self.subTest(more=more):
                self.refused(chunks + [(*more, b"\0")], "belong to no level")
        for change in (b"\0", b"\1"):
            self.refused(chunks[:-2] + [(*chunks[-2][:3], chunks[-2][3] + change), chunks[-1]], "add up")
        # Without models of its own, level 1 has those of level 0, which have parents.
        self.refused([c for c in chunks if c[1] == 0 or c[0] not in (b"MMOD", b"MODL")], "level 1 has parents")
        for fields in self.fine + [self.fine_mask]:
            fields.version = 1
        self.fine[0].background, self.masks = 70, [b"\1", b"\1"]
        self.pages = self.coarse_pages * 2
        self.coarse_masks = [b"\1"]
        chunks = [c for c in self.chunks() if c[1] == 0 or c[0] not in (b"MMOD", b"MODL")]
        self.assertEqual(self.decode(chunks), [(80, 70, 0, 9)] * 17)
        self.assertEqual(self.decode(chunks, 1), [(80, 70, 0, 9)] * 9)

    def test_pages(self):
        for level, name in ((0, "pages"), (1, "coarse_pages")):
            for channel in range(4):
                self.setUp()
                getattr(self, name)[channel] = b"\5\5\5\5"
                with self.subTest(level=level, channel=channel):
                    self.refused(self.chunks(), "level {}, page at .0, 0, 0.: page: it does not end".format(level))
                    if level == 0 or channel == 3:  # without the others level 0 can be decoded
                        self.refused(self.chunks(), "does not end", strict=False)
        for name in ("masks", "coarse_masks"):
            self.setUp()
            for bad in (b"\2", b"\0", b"\0\0\0"):
                getattr(self, name)[0] = bad
                self.refused(self.chunks(), "mask: ")
        # Of a void page a reader may look at the mask alone.
        self.setUp()
        good = self.decode(self.chunks())
        self.pages[5] = b"\5\5\5\5"
        self.refused(self.chunks(), "page at .16, 0, 0.: page: it does not end")
        self.assertEqual(self.decode(self.chunks(), 0, False), good)


# ---- With tools ------------------------------------------------------------------------------------------------------


def limited(*channels):
    return bytes(min(max(int(c), 0), 255) for c in channels)


def surfaces(noise, dims, size):
    """Smooth colours, void in half of the volume and here and there in the rest; opaque."""
    for z, y, x in itertools.product(*map(range, dims[::-1])):
        void = x + 2 * y + z > sum(dims) // 2 or noise.random() < 0.2
        red, blue = 40 + 9 * x + noise.randrange(3), 90 + 6 * z + 9 * x + noise.randrange(3)
        yield bytes(size) if void else limited(red, 50 + 9 * x + 5 * y, blue, 255)[:size]


def solid(noise, dims, size):
    """No voids; colours with little in common."""
    for z, y, x in itertools.product(*map(range, dims[::-1])):
        red, green = 200 - 9 * x + noise.randrange(5), 20 + 7 * y + noise.randrange(5)
        yield limited(red, green, 99 + 9 * z, 7 + noise.randrange(249))[:size]


def void(noise, dims, size):
    return [bytes(size)] * (dims[0] * dims[1] * dims[2])


def clear(noise, dims, size):
    """Alpha of any kind, much of it 0, of colours that are something nevertheless."""
    for z, y, x in itertools.product(*map(range, dims[::-1])):
        colour = limited(5 * x, 9 * y + 1, 3 * z, noise.choice((0, 0, 255, 1, 40 + 5 * x)))[:size]
        yield colour if noise.random() < 0.7 else bytes(size)


def few(noise, dims, size):
    colours = [bytes(size)] * 2 + [noise.randbytes(size) for _ in range(4)]
    for z, y, x in itertools.product(*map(range, dims[::-1])):
        yield colours[(x // 4 + y // 3 + z // 5) % 6] if noise.random() < 0.9 else noise.choice(colours)


def dark(noise, dims, size):
    """Hardly more than void, or as good as void."""
    for _ in range(dims[0] * dims[1] * dims[2]):
        yield bytes(noise.choice((0, 0, 0, 0, 1, 2)) for _ in range(size))


def wild(noise, dims, size):
    for _ in range(dims[0] * dims[1] * dims[2]):
        yield noise.randbytes(size) if noise.random() < 0.8 else bytes(size)


CONTENTS = (surfaces, solid, void, clear, few, dark, wild)
SHAPES = ((8, "on"), (16, "on"), (8, "off"))
DIMS = ((1, 1, 1), (17, 1, 30), (19, 18, 17), (28, 19, 5), (3, 12, 33))


@unittest.skipUnless(BIN, "VOXKIT_BIN is not set")
class Tools(PackedCase):
    def check(self, file, data, size):
        """What both make of it, and that it is no further from the original than it says; returns how it was stored."""
        packed, voxels = self.compare(file)
        solids = opaques = 0
        for at in range(0, len(data), size):
            old, new = data[at:at + size], voxels[at:at + size]
            self.assertLessEqual(math.dist(old[:3], new[:3]), packed.max_error + 1e-9)
            if not any(old):
                self.assertEqual(new, old)
            elif size == 4:
                self.assertEqual(new[3], old[3])
                solids, opaques = solids + 1, opaques + (new[3] == 255)
        if size == 4:
            self.assertEqual(packed.opaque, solids == opaques)
        seen = {("indexed", not packed.masked), ("differences", packed.differences), ("opaque", packed.opaque)}
        for level, models in enumerate(packed.models):
            self.assertEqual(models[0].parents, level < packed.count - 1)
            seen |= {("palette", m.has_palette) for m in models} | {("bound", m.bound > 0) for m in models}
            for at in itertools.product(*map(range, packed.pages(level))) if packed.masked else ():
                seen.add(("mask", models[0].parents, min(len(packed.page(level, at, MASK)), 2)))
        return seen

    def test_contents(self):
        seen, noise = set(), random.Random(1)
        # Of all combinations some.
        shapes, errors, all_dims = itertools.cycle(SHAPES), itertools.cycle((0, 4, 0, 30)), itertools.cycle(DIMS)
        for content, (kind, size), _ in itertools.product(CONTENTS, CHANNELS.items(), range(2)):
            (side, levels), error, dims = next(shapes), next(errors), next(all_dims)
            data = b"".join(content(noise, dims, size))
            with self.subTest(content=content.__name__, kind=kind, dims=dims, error=error, page=side, levels=levels):
                file = self.encode_raw(data, dims, kind, "--max-error", error, "--levels", levels, "--page", side)
                seen |= self.check(file, data, size)
        for way in ("indexed", "differences", "opaque", "palette", "bound"):
            self.assertLessEqual({(way, False), (way, True)}, seen)
        self.assertLessEqual({("mask", parents, size) for parents in (False, True) for size in (0, 1, 2)}, seen)

    def test_several_parts(self):
        """More pages than a part has, most of them void."""
        dims, noise = (8200, 1, 2), random.Random(2)
        data = (bytes(3 * 6000) + noise.randbytes(3 * 200) + bytes(3 * 1900) + noise.randbytes(3 * 100)) * 2
        packed, voxels = self.compare(self.encode_raw(data, dims, "rgb8", "--page", 8))
        self.assertEqual(voxels, data)
        for kind, part in itertools.product((b"PAGE", b"MASK"), (0, 1)):
            self.assertIn((kind, 0, part), packed.container.chunks)

    def test_built_ins_and_the_program(self):
        for source, options in (("menger:2", ()), ("menger:2", ("--page", 8, "--max-error", 30)),
                                ("menger:2", ("--levels", "off", "--max-error", 4)), ("menger:3", ("--page", 8))):
            with self.subTest(source=source, options=options):
                file = self.encode(source, *options)
                self.compare(file)
                if options:
                    continue
                info = json.loads(self.run_program(sys.executable, DECODER, "--info", file).stdout)
                said = json.loads(self.run_program(os.path.join(BIN, "vox-info"), file, "--json").stdout)
                for key in ("dims", "voxel_format"):
                    self.assertEqual(info[key], said[key])
                last = len(info["levels"]) - 1
                tool, reference = self.decode_both(DECODER, file, "good.raw", "--level", last)
                self.assertEqual(tool, reference)

    def test_hand_made_files(self):
        """What is valid, and what is not, of the small file above."""
        small = SmallFile()
        small.setUp()
        self.assertTrue(self.same_or_refused(container(small.chunks())))
        bad = b"\5\5\5\5"
        for name, at, pages in (
                ("masks", 0, (b"", b"\1\0", b"\0", bad, bytes(9))), ("masks", 1, (b"\1", b"\1\0", bad)),
                ("coarse_masks", 0, (b"", b"\1", b"\1\0", b"\2", bad)), ("pages", 3, (b"", b"\1\0", bad, bad * 3)),
                ("pages", 1, (b"\1", b"\1\1", b"\1\3", b"\1\0\0")), ("coarse_pages", 2, (b"\1", b"\1\1", bad)),
                ("pages", 5, (b"\1", bad))):
            for page in pages:
                small.setUp()
                getattr(small, name)[at] = page
                with self.subTest(name=name, at=at, page=page):
                    self.same_or_refused(container(small.chunks()))
        for at, values in ((2, range(1, 6)), (3, (0, 1, 2)), (4, (0, 1, 2))):
            for value in values:
                small.setUp()
                small.pakp[at] = value
                with self.subTest(at=at, value=value):
                    self.same_or_refused(container(small.chunks()))
        small.setUp()
        for kind, index, part, valid in ((b"MMOD", 0, 1, False), (b"MASK", 2, 0, False), (b"MODL", 1, 4, False),
                                         (b"NEWS", 1, 4, True)):
            self.assertEqual(self.same_or_refused(container(small.chunks() + [(kind, index, part, b"\0")])), valid)

    def random_file(self, noise):
        """Valid, but not as our writer has it: models of any weights, bounds, palettes and numbers, and residuals of any
        kind. All tables of a model are the same, and all contexts of a mask model have the same number."""
        dims, size = [noise.randrange(1, 24) for _ in range(3)], noise.choice((3, 4))
        dims[noise.randrange(3)] = 1 + noise.randrange(4)
        differences, coarsest = noise.randrange(2), noise.randrange(3)
        grids = [[-(-d // 8) for d in dims]]
        while max(grids[-1]) > 1:
            dims_here = [-(-d // (1 << len(grids))) for d in dims]
            grids.append([-(-d // 8) for d in dims_here])
        chunks = [(b"VOLI", 0, 0, struct.pack("<3QBB6x3d3d2d2d", *dims, 5 - size, 1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0)),
                  (b"PAKP", 0, 0, struct.pack("<5B3x3d32x", 3, len(grids), 4, 0, differences, 0, 0, 0))]
        above = {}
        for level in range(len(grids) - 1, -1, -1):
            version = 2 if level < len(grids) - 1 - coarsest else 1
            number, models = noise.randrange(1, 32), []
            mask_fields = MaskFields(version, {c: number for c in range(8192)})
            for channel in range(size):
                most = noise.choice((255, 1, 9, 510 if differences and channel in (1, 2) else 200))
                palette = sorted(noise.sample(range(256), most + 1)) if most < 10 else None
                weights = {(noise.randrange(48), noise.randrange(30)): noise.randrange(-3000, 3000) for _ in range(200)}
                models.append(Fields(version=version, most=most, bound=0 if palette else noise.choice((0, 1, 30)),
                                     background=noise.randrange(most + 1), palette=palette, weights=weights,
                                     parts=(900, 500, 300, 200)))
            masks, pages, here = [], [], {}
            dims_here = [-(-d // (1 << level)) for d in dims]
            for z, y, x in itertools.product(*map(range, grids[level][::-1])):
                shape = [min(8, d - 8 * i) for i, d in zip((x, y, z), dims_here)]
                may = [True] * math.prod(shape)
                if version == 2:
                    parents, parents_shape = above[x // 2, y // 2, z // 2]
                    may = [parents[((z % 2 * 4 + k // 2) * parents_shape[1] + y % 2 * 4 + j // 2) * parents_shape[0] +
                                   x % 2 * 4 + i // 2] for k, j, i in itertools.product(*map(range, shape[::-1]))]
                way, chance = noise.randrange(6), noise.random()
                mask = [m and way > 0 and (way == 1 or noise.random() < chance) for m in may]
                coded = mask_fields.page([(0, m) for m, v in zip(mask, may) if v])
                masks.append((b"", b"\1", coded, coded, coded, coded)[way])
                here[x, y, z] = mask, shape
                for model in models:
                    folded = [noise.choice((0, 0, 1, 2, 3, noise.randrange(200))) for m in mask if m]
                    one = noise.randrange(model.most + 1).to_bytes(1 if model.most < 256 else 2, "little")
                    pages.append(noise.choice((b"", one, model.page(folded), model.page(folded))))
            above = here
            chunks.append((b"MMOD", level, 0, mask_fields.bytes()))
            chunks += [(b"MODL", level, c, model.bytes()) for c, model in enumerate(models)]
            chunks += [(b"MASK", level, 0, SmallFile.part(masks)), (b"PAGE", level, 0, SmallFile.part(pages))]
        return container(chunks)

    def test_files_of_no_writer(self):
        noise = random.Random(5)
        for number in range(10):
            with self.subTest(number=number):
                write(self.path("made.svmm"), self.random_file(noise))
                self.compare(self.path("made.svmm"))

    def test_damage_with_right_checksums(self):
        noise, seen = random.Random(4), [0, 0]
        for content, kind, error, dims in ((surfaces, "rgba8", 0, (21, 19, 10)), (clear, "rgba8", 4, (17, 16, 12)),
                                           (few, "rgb8", 0, (11, 9, 10)), (surfaces, "rgb8", 30, (29, 17, 14)),
                                           (dark, "rgb8", 4, (5, 9, 5))):
            data = b"".join(content(noise, dims, CHANNELS[kind]))
            file = self.encode_raw(data, dims, kind, "--max-error", error, "--page", 8)
            with open(file, "rb") as opened:
                indexed = b"CTAB" in opened.read()
            self.assertEqual(indexed, content in (few, dark))
            for kinds in (((b"PAKP", b"MODL", b"CTAB"), (b"CTAB", b"PAGE")) if indexed else
                          ((b"PAKP", b"MODL", b"MMOD"), (b"MMOD", b"MASK"), (b"MASK", b"PAGE"))):
                with self.subTest(content=content.__name__, kind=kind, error=error):
                    counts_of = self.damage(file, noise, kinds, 7)
                    seen = [a + b for a, b in zip(seen, counts_of)]
        self.assertGreater(min(seen), 5, seen)


if __name__ == "__main__":
    unittest.main()
