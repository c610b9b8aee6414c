"""Writes files with an octree of any trees, for the tests of coloured surfaces."""

import struct

from helpers import container
from octree_decode import CHUNK, NODES, ROW, LAYER, go_through
from packed_cases import BitWriter, decisions
from page_decode import DECISIONS


def morton(place):
    return sum((c >> i & 1) << 3 * i + axis for axis, c in enumerate(place) for i in range(21))


def random_tree(noise, questions):
    """Of up to so many questions on the way, as read_tree() returns it."""
    if questions == 0 or noise.random() < 0.1:
        return DECISIONS[noise.randrange(1, 32)]
    return noise.randrange(156), random_tree(noise, questions - 1), random_tree(noise, questions - 1)


def put_tree(out, tree):
    if type(tree) is tuple:
        out.put(1, 1).put(tree[0], 8)
        put_tree(out, tree[1])
        put_tree(out, tree[2])
    else:
        out.put(0, 1).put(0 if tree is None else DECISIONS.index(tree), 5)


class OctreeFile:
    """Voxels at `places`, each of the colour (1, 2, 3) or what color() makes of its place. `trees`: from the root's height
    down. All that is written can be changed before file() is called; `trees` before code() is."""

    def __init__(self, dims, places, trees, color=lambda place: (1, 2, 3)):
        self.dims, self.places, self.trees, self.color = dims, sorted(places, key=morton), trees, color
        self.height = max(2, (max(dims) - 1).bit_length())
        self.voli = struct.pack("<3QBB6x3d3d2d2d", *dims, 1, 1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0)
        self.dagp = bytearray(struct.pack("<8BQQI4x2d5Q3xB36x", 1, 1, 1, 1, self.height, 0, 1, 0, len(places), len(places), 0, 0, 0,
                                          0, 0, 0, 0, 0, 2))
        self.colr = b"".join(bytes(color(place)) for place in self.places)
        self.code()

    def code(self):
        bits = BitWriter()
        for tree in self.trees:
            put_tree(bits, tree)
        self.tree_bytes = bits.bytes()
        self.pages, self.children = [], []
        for h, tree in zip(range(self.height, 0, -1), self.trees):
            octants, codes = {}, {}
            for place in self.places:
                node = tuple(c >> h for c in place)
                codes[node] = morton(node)
                octants.setdefault(node, set()).add(morton([c >> h - 1 & 1 for c in place]))
            nodes = sorted(octants, key=codes.get)
            places = [x + ROW * y + LAYER * z for x, y, z in nodes]
            numbers = {place: number for number, place in enumerate(places)}
            for first in range(0, len(nodes), NODES):
                end, taken = min(first + NODES, len(nodes)), []

                def choose(parts, node, o):
                    taken.append((parts, o in octants[nodes[node]]))
                    return taken[-1][1]

                go_through(tree, places, numbers, first, end, choose)
                self.pages.append(decisions(taken, 1))
                self.children.append(sum(len(octants[node]) for node in nodes[first:end]))

    def directory(self):
        entries = b"".join(struct.pack("<HH", c, len(page)) for c, page in zip(self.children, self.pages))
        return struct.pack("<I", len(self.tree_bytes)) + self.tree_bytes + entries if self.pages else b""

    def masks(self):
        """The contents of the chunks MASK."""
        parts = [b""]
        for page in self.pages:
            parts[-1] += page
            if len(parts[-1]) >= CHUNK:
                parts.append(b"")
        return [part for part in parts if part]

    def chunks(self):
        return ([(b"VOLI", 0, 0, self.voli), (b"DAGP", 0, 0, bytes(self.dagp)), (b"OCTD", 0, 0, self.directory())] +
                [(b"MASK", 0, i, part) for i, part in enumerate(self.masks())] + ([(b"COLR", 0, 0, self.colr)] if self.colr else []))

    def file(self):
        return container(self.chunks(), codec=3)

    def voxels(self):
        """What is to be decoded."""
        out = bytearray(4 * self.dims[0] * self.dims[1] * self.dims[2])
        for x, y, z in self.places:
            at = 4 * ((z * self.dims[1] + y) * self.dims[0] + x)
            out[at:at + 4] = bytes(self.color((x, y, z))) + b"\xff"
        return out
