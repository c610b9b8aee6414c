#!/usr/bin/env python3
"""Octrees of coloured surfaces, the reference decoder against the tools: VOXKIT_BIN=build/bin python3 test_octree_refdec.py

Without VOXKIT_BIN only the tests that need no tool are run.
"""

import itertools
import os
import random
import struct
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
from container import Container, Refused  # noqa: E402
from dag_decode import Surface, decode  # noqa: E402
from helpers import BIN, container, read, write  # noqa: E402
from octree_cases import OctreeFile, morton, random_tree  # noqa: E402
from octree_decode import LAYER, ROW, go_through, places_below  # noqa: E402
from test_dag_refdec import SurfaceCase  # noqa: E402


def some(noise, dims, share):
    """Places of some voxels."""
    return [place[::-1] for place in itertools.product(*map(range, dims[::-1])) if noise.random() < share]


def chain(questions):
    """So many questions, one after the other."""
    return (7, 1148, chain(questions - 1)) if questions else 900


def rgba(noise, dims, share):
    """A volume of which some voxels are there."""
    return b"".join(bytes(noise.randrange(256) for _ in range(3)) + b"\xff" if noise.random() < share else bytes(4)
                    for _ in range(dims[0] * dims[1] * dims[2]))


# ---- Without tools ---------------------------------------------------------------------------------------------------


class Facts(unittest.TestCase):
    def test_all_against_the_text(self):
        """A page in the middle of a height: of every bit, whether a fact is true, beside a search of sets."""
        noise = random.Random(1)
        nodes = sorted((tuple(noise.randrange(4) for _ in range(3)) for _ in range(60)), key=morton)
        nodes = [node for i, node in enumerate(nodes) if i == 0 or nodes[i - 1] != node]
        first, end = 9, 30
        octants = {node: noise.sample(range(8), noise.randrange(1, 9)) for node in nodes}
        places = [x + ROW * y + LAYER * z for x, y, z in nodes]
        numbers = {place: number for number, place in enumerate(places)}
        for fact in range(156):
            solid, found, expected = set(), [], []

            def choose(parts, node, o):
                found.append(parts == 2047)
                return o in octants[nodes[node]]

            go_through((fact, 1, 2047), places, numbers, first, end, choose)
            for number in range(first, end):
                node = nodes[number]
                available = {(2 * n[0] + o % 2, 2 * n[1] + o // 2 % 2, 2 * n[2] + o // 4)
                             for i, n in enumerate(nodes) if i < first or i > number for o in range(8)}
                for o in range(8):
                    here = (2 * node[0] + o % 2, 2 * node[1] + o // 2 % 2, 2 * node[2] + o // 4)
                    before = [p for p in octants[node] if p < o]
                    if fact < 125:
                        shift = fact % 5 - 2, fact // 5 % 5 - 2, fact // 25 - 2
                        true = tuple(a + b for a, b in zip(here, shift)) in solid
                    elif fact < 152:
                        shift = (fact - 125) % 3 - 1, (fact - 125) // 3 % 3 - 1, (fact - 125) // 9 - 1
                        true = tuple(a + b for a, b in zip(here, shift)) in available
                    else:
                        true = not before if fact == 155 else bool(o & (1, 2, 4)[fact - 152])
                    if o < 7 or before:
                        expected.append(true)
                    if o in octants[node]:
                        solid.add(here)
            with self.subTest(fact=fact):
                self.assertEqual(found, expected)

    def test_places(self):
        self.assertEqual(places_below([0, 5 + 7 * ROW + 1 * LAYER], [0b10010, 0b10000001]),
                         [1, LAYER, 10 + 14 * ROW + 2 * LAYER, 11 + 15 * ROW + 3 * LAYER])


class SmallFile(unittest.TestCase):
    def setUp(self):
        """All of 8 x 8 x 8 voxels: by any parts from 2 on, and the state 1, every bit is 1. Every byte is written here."""
        self.voli = struct.pack("<3QBB6x3d3d2d2d", 8, 8, 8, 1, 1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0)
        self.dagp = bytearray(struct.pack("<7BxQQI4x2d5Q3xB36x", 1, 1, 1, 1, 3, 0, 1, 512, 512, 0, 0, 0, 0, 0, 0, 0, 0, 2))
        # Trees of one number each: 0 and 16; 1, fact 155, numbers 31 and 16; 0 and 16. That is, of each byte from its lowest
        # bit on, 0 00001 1 1 | 1011001 0 | 11111 0 00 | 001 0 0000 | 1, and zeros.
        self.trees = bytearray((0b11100000, 0b01001101, 0b00011111, 0b00000100, 0b00000001))
        self.pages = [(8, b"\1"), (64, b"\1"), (512, b"\1")]
        self.colr = bytes(range(256)) * 6

    def chunks(self):
        directory = struct.pack("<I", len(self.trees)) + bytes(self.trees)
        directory += b"".join(struct.pack("<HH", children, len(page)) for children, page in self.pages)
        return {(b"VOLI", 0, 0): self.voli, (b"DAGP", 0, 0): bytes(self.dagp), (b"OCTD", 0, 0): directory,
                (b"MASK", 0, 0): b"".join(page for _, page in self.pages), (b"COLR", 0, 0): self.colr}

    @staticmethod
    def file(chunks):
        return container([(*key, data) for key, data in chunks.items()], codec=3)

    def test_decodes(self):
        out = decode(Surface(Container(self.file(self.chunks()))))
        for place in ((0, 0, 0), (7, 7, 7), (1, 2, 4), (3, 0, 6)):
            at = morton(place)
            expected = [(3 * at + i) % 256 for i in range(3)] + [255]
            self.assertEqual(list(out[4 * (64 * place[2] + 8 * place[1] + place[0]):][:4]), expected)

    def broken(self):
        """(what is broken, the file): each of these breaks one rule."""

        def made(rule, change=lambda: None, **other):
            """`change` what the file is made of; and chunks: their content, what makes it of what it was, or None."""
            self.setUp()
            change()
            chunks = self.chunks()
            for name, data in other.items():
                key = name[:4].encode(), int(name[4:5] or 0), int(name[5:] or 0)
                chunks[key] = data(chunks[key]) if callable(data) else data
            return rule, self.file({key: data for key, data in chunks.items() if data is not None})

        def put(name, at, value):
            return lambda: getattr(self, name).__setitem__(at, value)

        def page(at, children, data):
            return lambda: self.pages.__setitem__(at, (children, data))

        def voxels(count, last):
            return lambda: (self.voxels(count), page(2, last, b"\1")())

        yield made("OCTD, MASK", put("dagp", 91, 1))
        yield made("byte 91", put("dagp", 91, 3))
        yield made("OCTD, MASK", put("dagp", 91, 0))
        yield made("OCTD, MASK", put("dagp", 91, 0), OCTD=None, LEAF=bytes(8), NODE3=b"")
        yield made("OCTD, MASK", put("dagp", 91, 0), MASK=None, LEAF=bytes(8), NODE3=b"")
        yield made("byte 24", put("dagp", 24, 1))
        yield made("LEAF, NODE", LEAF=bytes(8))
        yield made("LEAF, NODE", NODE3=b"")
        yield made("LEAF, NODE", SNOD3=b"")
        yield made("OCTD", OCTD=None)
        yield made("OCTD", OCTD1=b"")
        yield made("OCTD", OCTD01=b"")
        yield made("no part 0", MASK=None)
        yield made("not their parts", MASK=None, MASK01=b"\1\1\1")
        yield made("not their parts", MASK=None, MASK1=b"\1\1\1")
        yield made("3 pages in 2 chunks", MASK01=b"\1")
        yield made("3 pages in 2 chunks", MASK01=b"")
        yield made("2 bytes, expected 3", MASK=b"\1\1")
        yield made("4 bytes, expected 3", MASK=b"\1\1\1\1")
        # Chunks end with the page with which they have 65536 bytes, no sooner.
        yield made("1 bytes, expected 3", MASK=b"\1", MASK01=b"\1\1")
        yield made("OCTD: 0 bytes", OCTD=b"")
        yield made("OCTD: 3 bytes", OCTD=bytes(3))
        yield made("of trees, of", OCTD=lambda data: b"\xff" + data[1:])
        yield made("cut off", OCTD=lambda data: bytes(4) + data[9:])
        yield made("cut off", OCTD=lambda data: b"\4" + data[1:8] + data[9:])
        yield made("the number 0", put("trees", 0, 0b11000000))
        yield made("fact 157", put("trees", 1, 0b01001110))
        yield made("fact 255", put("trees", 1, 0b01111111))
        yield made("behind the trees", put("trees", 4, 0b00000011))
        yield made("behind the trees", put("trees", 4, 0b10000001))
        yield made("behind the trees", lambda: self.trees.append(0))
        yield made("bytes of pages", OCTD=lambda data: data + b"\0")
        yield made("4 pages in 1 chunks, expected 3", lambda: self.pages.append((1, b"\1")))
        yield made("4 pages in 1 chunks, expected 3", OCTD=lambda data: data + bytes(4))
        yield made("no entry of page 2", lambda: self.pages.pop())
        yield made("page of no bytes", page(1, 64, b""))
        yield made("511 voxels", page(2, 511, b"\1"))
        yield made("510 voxels", voxels(511, 510))
        yield made("have not 511", voxels(511, 511))
        yield made("have not 63", page(1, 63, b"\1"))
        yield made("have not 7", page(0, 7, b"\1"))
        for data in (b"\0", b"\2", b"\1\1", b"\1" + bytes(7) + b"\1", bytes(4) + b"\1\1\0\0\0"):
            yield made("does not end|have not", page(1, 64, data))
        yield made("outside the volume", lambda: setattr(self, "voli", struct.pack("<3Q", 8, 7, 8) + self.voli[24:]))
        none = {"COLR": None}
        yield made("an octree", lambda: self.voxels(0), **none)
        yield made("an octree", lambda: self.voxels(0), MASK=None, **none)
        yield made("an octree", lambda: self.voxels(0), OCTD=b"", **none)

    def voxels(self, count):
        struct.pack_into("<QQ", self.dagp, 8, count, count)
        self.colr = self.colr[:3 * count]

    def test_broken_rules(self):
        for rule, data in self.broken():
            with self.subTest(rule=rule), self.assertRaisesRegex(Refused, rule):
                decode(Surface(Container(data)))

    def odd(self):
        """With what a reader ignores: bytes that are zero, chunks of kinds that are not known. A state has zeros on top."""
        self.dagp[92], self.dagp[93], self.dagp[127], self.pages[1], self.pages[2] = 0xe0, 1, 255, (64, b"\1\0"), (512, b"\1" + bytes(7))
        return self.file({**self.chunks(), (b"NEWS", 7, 7): b"?"})

    def test_what_is_ignored(self):
        good = decode(Surface(Container(self.file(self.chunks()))))
        self.assertEqual(decode(Surface(Container(self.odd()))), good)

    def no_voxels(self):
        self.voxels(0)
        chunks = {**self.chunks(), (b"OCTD", 0, 0): b""}
        del chunks[b"MASK", 0, 0], chunks[b"COLR", 0, 0]
        return self.file(chunks)

    def test_no_voxels(self):
        self.assertEqual(decode(Surface(Container(self.no_voxels()))), bytes(2048))

    def test_questions(self):
        """At most 48."""
        places = some(random.Random(2), (4, 4, 4), 0.3)
        made = OctreeFile((4, 4, 4), places, [chain(48), chain(48)])
        self.assertEqual(decode(Surface(Container(made.file()))), made.voxels())
        made = OctreeFile((4, 4, 4), places, [chain(3), chain(49)])
        with self.assertRaisesRegex(Refused, "more than 48"):
            decode(Surface(Container(made.file())))


# ---- With tools ------------------------------------------------------------------------------------------------------


@unittest.skipUnless(BIN, "VOXKIT_BIN is not set")
class Tools(SurfaceCase):
    def encode(self, source, *options):
        return super().encode(source, "--geometry", "octree", *options)

    def compare(self, file):
        info = super().compare(file)
        self.assertEqual(info["geometry"], "octree")
        return info

    def test_built_ins(self):
        for source, options in (
                ("menger:3", ()), ("menger:3", ("--codec", "raw", "--zstd", "3", "--counts", "pointer")),
                ("menger:2", ("--colors", "all", "--counts", "pointer")),
                ("menger:3", ("--curve", "hilbert", "--colors", "all", "--codec", "palette")),
                ("menger:2", ("--curve", "hilbert", "--codec", "png", "--counts", "pointer")),
                ("menger:2", ("--codec", "bc1", "--image-curve", "hilbert"))):
            with self.subTest(source=source, options=options):
                self.compare(self.encode(source, *options))

    def encode_raw(self, data, dims, *options):
        write(self.path("in.raw"), data)
        return self.encode(self.path("in.raw"), "--dims", "%d,%d,%d" % dims, "--type", "rgba8", *options)

    def test_volumes(self):
        """One, few and many voxels; sides that are not powers of two, one that is longer than the others."""
        noise = random.Random(1)
        for dims, share, options in (((1, 1, 1), 1, ()), ((70, 3, 9), 0.1, ("--colors", "all")),
                                     ((1, 300, 2), 0.5, ("--codec", "fws", "--curve", "hilbert")), ((17, 19, 21), 0.7, ("-e", "1")),
                                     ((33, 34, 31), 0.01, ("--colors", "all", "--counts", "pointer"))):
            with self.subTest(dims=dims, options=options):
                self.compare(self.encode_raw(rgba(noise, dims, share), dims, *options))

    def test_pages(self):
        """More nodes than a page has, whose masks have patterns across pages."""
        dims = (60, 48, 41)
        data = bytearray(4 * dims[0] * dims[1] * dims[2])
        for z, y, x in itertools.product(*map(range, dims[::-1])):
            if (x + y // 2 + z) % 11 == 0 or (x * y + z) % 97 == 3:
                at = 4 * ((z * dims[1] + y) * dims[0] + x)
                data[at:at + 4] = bytes((x, y, z, 255))
        file = self.encode_raw(data, dims, "--codec", "raw")
        self.compare(file)
        self.assertGreater(len(Surface(Container(read(file))).other.pages[1]), 1)
        self.assertEqual(read(self.path("tool-good.raw")), bytes(data))

    def test_several_chunks(self):
        """Noise, of which nothing can be foretold."""
        noise, dims = random.Random(3), (83, 81, 83)
        there = [noise.getrandbits(1) for _ in range(dims[0] * dims[1] * dims[2])]
        data = b"".join(b"\1\2\3\xff" if voxel else bytes(4) for voxel in there)
        file = self.encode_raw(data, dims, "--codec", "palette")
        self.compare(file)
        self.assertEqual(read(self.path("tool-good.raw")), data)
        octree = Surface(Container(read(file))).other
        self.assertGreater(min(len(octree.chunks), len(octree.pages[2])), 1)

    def test_files_of_no_writer(self):
        """Trees of any facts and numbers."""
        noise = random.Random(5)
        for number, (dims, share, questions) in enumerate((((11, 23, 14), 0.3, 9), ((64, 5, 5), 0.5, 12), ((36, 35, 37), 0.16, 4),
                                                           ((2, 2, 2), 0.6, 4), ((90, 11, 44), 0.003, 9), ((9, 8, 7), 1, 8))):
            places = some(noise, dims, share)
            trees = [random_tree(noise, questions) for _ in range(max(2, (max(dims) - 1).bit_length()))]
            made = OctreeFile(dims, places, trees, lambda place: (place[0], place[1] * 3, place[2] * 5))
            with self.subTest(number=number):
                write(self.path("made.dagc"), made.file())
                self.compare(self.path("made.dagc"))
                self.assertEqual(read(self.path("tool-good.raw")), made.voxels())

    def test_tools_refuse_what_is_broken(self):
        small = SmallFile()
        for rule, data in small.broken():
            with self.subTest(rule=rule):
                self.assertIsNone(self.decoded_by_tool(data))
        small.setUp()
        self.assertEqual(self.decoded_by_tool(small.odd()), decode(Surface(Container(small.file(small.chunks())))))
        self.assertEqual(self.decoded_by_tool(small.no_voxels()), bytes(2048))
        places = some(random.Random(2), (4, 4, 4), 0.3)
        for questions, expected in ((48, True), (49, False)):
            made = OctreeFile((4, 4, 4), places, [chain(3), chain(questions)])
            self.assertEqual(self.decoded_by_tool(made.file()), made.voxels() if expected else None)

    def decoded_by_tool(self, data):
        """None if it refuses."""
        write(self.path("bad.dagc"), data)
        done = subprocess.run([os.path.join(BIN, "vox-decode"), self.path("bad.dagc"), "-f", "-q", "-o", self.path("bad.raw")],
                              stderr=subprocess.PIPE)
        self.assertIn(done.returncode, (0, 3), done.stderr)
        self.assertEqual(len(done.stderr.splitlines()), 1 if done.returncode else 0, done.stderr)
        return read(self.path("bad.raw")) if done.returncode == 0 else None

    def test_damage_with_right_checksums(self):
        """Both refuse it, or both make the same of it."""
        noise, seen = random.Random(4), [0, 0]
        files = [read(self.encode("menger:2", "--codec", "raw"))]
        files.append(read(self.encode_raw(rgba(noise, (23, 9, 14), 0.1), (23, 9, 14), "--codec", "raw")))
        places = some(noise, (12, 13, 14), 0.4)
        files.append(OctreeFile((12, 13, 14), places, [random_tree(noise, 6) for _ in range(4)]).file())
        for number, file in enumerate(files):
            good = Container(file)
            chunks = [[*key, bytes(good.data[c.offset:c.offset + c.length])] for key, c in good.chunks.items()]
            for change in range(45):
                changed = [list(c) for c in chunks]
                chunk = noise.choice([c for c in changed if c[0] in (b"OCTD", b"MASK", b"DAGP")])
                content = bytearray(chunk[3])
                at = noise.randrange(min(len(content), 92))
                content[at] = noise.choice((content[at] ^ 1 << noise.randrange(8), noise.randrange(256)))
                if noise.random() < 0.05:
                    del content[noise.randrange(len(content)):]
                chunk[3] = bytes(content)
                data = container(changed, codec=3)
                try:
                    expected = decode(Surface(Container(data)))
                except Refused:
                    expected = None
                with self.subTest(number=number, change=change, chunk=chunk[0], at=at):
                    self.assertEqual(self.decoded_by_tool(data), expected)
                seen[expected is not None] += 1
        self.assertGreater(min(seen), 10, seen)


if __name__ == "__main__":
    unittest.main()
