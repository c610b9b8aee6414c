"""Octrees, from section 4.9 of formats/FORMAT.md alone. For dag_decode.py."""

import struct

from container import require
from page_decode import DECISIONS, Bits, State, decide

NODES, CHUNK = 4096, 65536
FACTS, QUESTIONS = 156, 48
ROW, LAYER = 1 << 22, 1 << 44  # a place is one number, x + ROW y + LAYER z; no node is there below 0 or from 2^20 on


def read_tree(bits, questions=0):
    """A number of parts, or (fact, the tree where it is not true, the tree where it is)."""
    if not bits.get(1):
        number = bits.get(5)
        require(number > 0, "chunk OCTD: a tree: the number 0")
        return DECISIONS[number]
    fact = bits.get(8)
    require(fact < FACTS, "chunk OCTD: a tree: fact {}", fact)
    require(questions < QUESTIONS, "chunk OCTD: a tree: more than {} questions on the way", QUESTIONS)
    return fact, read_tree(bits, questions + 1), read_tree(bits, questions + 1)


def cell_of(o, i, j, k):
    """Where the cell at (i, j, k) from octant o is: how far its node is, and its octant there."""
    x, y, z = o % 2 + i, o // 2 % 2 + j, o // 4 + k
    return x // 2 + ROW * (y // 2) + LAYER * (z // 2), x % 2 + 2 * (y % 2) + 4 * (z % 2)


TWO, ONE = range(-2, 3), range(-1, 2)
SOLID = [[cell_of(o, i, j, k) for k in TWO for j in TWO for i in TWO] for o in range(8)]
OPEN = [[cell_of(o, i, j, k)[0] for k in ONE for j in ONE for i in ONE] for o in range(8)]


def go_through(tree, places, numbers, first, end, choose):
    """The masks of nodes `first` to `end` - 1, a page. `places`: of all nodes of the height; `numbers`: those of the
    nodes at these places. `choose`: of the parts of 2048 that a bit being 1 has, the node and the octant, the bit."""
    masks = [0] * (end - first)  # of nodes, and octants, that come later, no bit is set

    def true(fact, node, o):
        if fact < 125:
            distance, octant = SOLID[o][fact]
            other = numbers.get(places[node] + distance, -1)
            return first <= other < end and masks[other - first] >> octant & 1
        if fact < 152:
            other = numbers.get(places[node] + OPEN[o][fact - 125])
            return other is not None and not first <= other <= node
        return masks[node - first] == 0 if fact == 155 else o >> fact - 152 & 1

    for node in range(first, end):
        for o in range(8):
            at = tree
            if o < 7 or masks[node - first]:
                while type(at) is tuple:
                    at = at[2 if true(at[0], node, o) else 1]
                bit = choose(at, node, o)
            else:
                bit = 1
            masks[node - first] |= bit << o
    return masks


def places_below(places, masks):
    """Of the children of nodes, in Morton order. A place is doubled, coordinate by coordinate, as its number is."""
    steps = [o % 2 + ROW * (o // 2 % 2) + LAYER * (o // 4) for o in range(8)]
    return [2 * place + steps[o] for place, mask in zip(places, masks) for o in range(8) if mask >> o & 1]


class Octree:
    """The directory is read at once, the masks by read_masks()."""

    def __init__(self, container, height, voxels):
        self.container, self.height = container, height
        kinds = [c.kind for c in container.chunks.values()]
        require(not {b"LEAF", b"NODE", b"SNOD"} & set(kinds), "chunks LEAF, NODE and SNOD: in a file with an octree")
        directory = container.only(b"OCTD")
        self.chunks = sorted((c for c in container.chunks.values() if c.kind == b"MASK"), key=lambda c: c.part)
        require([(c.index, c.part) for c in self.chunks] == [(0, i) for i in range(len(self.chunks))], "chunks MASK: not their parts")
        self.pages = {h: [] for h in range(height, 0, -1)}  # of each height: (children, where it begins, bytes)
        if voxels == 0:
            require(directory.length == 0 and not self.chunks, "chunk OCTD: there are no voxels, but an octree")
            return
        require(directory.length >= 4, "chunk OCTD: {} bytes", directory.length)
        data = bytes(container.data[directory.offset:directory.offset + directory.length])
        size, = struct.unpack_from("<I", data)
        require(4 + size <= len(data), "chunk OCTD: byte 0: {} bytes of trees, of {}", size, len(data))
        self.read_trees(Bits(data[4:4 + size]))
        self.read_pages(data[4 + size:], voxels)

    def read_trees(self, bits):
        self.trees = {h: read_tree(bits) for h in self.pages}
        used = (bits.at + 7) // 8
        require(bits.get(8 * used - bits.at) == 0 and used == len(bits.data), "chunk OCTD: bits behind the trees")

    def read_pages(self, entries, voxels):
        require(len(entries) % 4 == 0, "chunk OCTD: {} bytes of pages", len(entries))
        entries = list(struct.iter_unpack("<HH", entries))
        self.nodes, at, count = {}, 0, 1  # of each height: how many there are
        chunk, used = 0, 0
        for h in self.pages:
            require(count < 1 << 32, "chunk OCTD: {} nodes of height {}", count, h)
            self.nodes[h], pages = count, -(-count // NODES)
            require(at + pages <= len(entries), "chunk OCTD: no entry of page {}", len(entries))
            count = sum(children for children, _ in entries[at:at + pages])
            for children, size in entries[at:at + pages]:
                require(size > 0, "chunk OCTD: a page of no bytes")
                require(chunk < len(self.chunks), "chunks MASK: no part {}", chunk)
                self.pages[h].append((children, self.chunks[chunk].offset + used, size))
                used += size
                at += 1
                if used >= CHUNK or at == len(entries):
                    require(used == self.chunks[chunk].length, "chunk MASK: part {}: {} bytes, expected {}", chunk,
                            self.chunks[chunk].length, used)
                    chunk, used = chunk + 1, 0
        require(at == len(entries) and chunk == len(self.chunks), "chunk OCTD: {} pages in {} chunks, expected {} in {}", len(entries),
                len(self.chunks), at, chunk)
        require(count == voxels, "chunk OCTD: {} voxels, expected {}", count, voxels)

    def read_masks(self):
        """Of each height the masks of its nodes, and the number of the first child of each."""
        self.masks, self.firsts, places = {}, {}, [0]
        for h, pages in self.pages.items():
            numbers = {place: number for number, place in enumerate(places)}
            masks = []
            for children, at, size in pages:
                state = State(bytes(self.container.data[at:at + size]))
                found = go_through(self.trees[h], places, numbers, len(masks), min(len(masks) + NODES, len(places)),
                                   lambda parts, node, o: decide(state, parts))
                require(state.value == 1 and not state.words, "page: it does not end where its nodes end")
                require(sum(bin(mask).count("1") for mask in found) == children, "page: its nodes have not {} children", children)
                masks += found
            self.masks[h], self.firsts[h] = masks, [0]
            for mask in masks:
                self.firsts[h].append(self.firsts[h][-1] + bin(mask).count("1"))
            places = places_below(places, masks) if h > 1 else ()

    def children(self, h, number):
        """(octant, number of the node) of all octants of a node that have voxels."""
        octants = [o for o in range(8) if self.masks[h][number] >> o & 1]
        return [(o, self.firsts[h][number] + i) for i, o in enumerate(octants)]

    def word(self, number):
        """A node of height 2 as a word of section 4.2."""
        return sum(self.masks[1][child] << 8 * o for o, child in self.children(2, number))
