"""DAGs with symmetry, from formats/FORMAT.md, section 4.10: what lies in each octant of a cell, and words of 4 x 4 x 4 voxels."""

from container import require


def mirrored(bits, side, mirror):
    """The bits of a cell of `side` voxels an edge, in Morton order, mirrored."""
    result, levels = 0, side.bit_length() - 1
    # Morton codes of places: bit 3 i of a code is bit i of x; x becomes side - 1 - x: each of its bits changes.
    flip = sum((mirror >> a & 1) << 3 * i + a for i in range(levels) for a in range(3))
    for code in range(side ** 3):
        if bits >> code & 1:
            result |= 1 << (code ^ flip)
    return result


class SymmetricNodes:
    """The chunks SNOD and LEAF of a file. A pointer is (address, mirror), or (word, mirror) as ('word', bits) with a mirror."""

    def __init__(self, leaves, chunks, height):
        self.leaves, self.chunks, self.height = leaves, chunks, height
        self.begins = {h: self.check_height(h) for h in range(3, height + 1)}

    def check_height(self, h):
        """Where nodes begin: one after the other, and nothing else."""
        chunk, begins, at = self.chunks[h], set(), 0
        require(len(chunk) <= (1 << 28 if h == 3 else 1 << 29), "chunk SNOD {}: {} bytes", h, len(chunk))
        while at < len(chunk):
            begins.add(at)
            _, _, at = self.parse(h, at)
        return begins

    def take(self, h, at, count):
        require(at + count <= len(self.chunks[h]), "chunk SNOD {}: byte {}: the node ends behind it", h, at)
        return self.chunks[h][at:at + count], at + count

    def parse(self, h, at):
        """What the octants of the node at a byte have, as it is stored; its count of colours; where it ends."""
        codes, at = self.take(h, at, 2)
        codes = int.from_bytes(codes, "little")
        octants = [(o, codes >> 2 * o & 3) for o in range(8) if codes >> 2 * o & 3]
        require(octants, "chunk SNOD {}: byte {}: no octants", h, at - 2)
        count, shift = 0, 0
        while True:
            byte, at = self.take(h, at, 1)
            count |= (byte[0] & 127) << shift
            shift += 7
            if byte[0] < 128:
                break
            require(shift < 70, "chunk SNOD {}: byte {}: a count of more than ten bytes", h, at)
        found = {}
        for octant, code in octants:
            if h == 3 and code == 3:
                continue
            raw, at = self.take(h, at, code + 1)
            number = int.from_bytes(raw, "little")
            found[octant] = (number >> 3, number & 7)
        for octant, code in octants:
            if octant in found:
                continue
            mask, at = self.take(h, at, 1)
            bits = 0
            require(mask[0] != 0, "chunk SNOD {}: byte {}: a word without voxels", h, at)
            for o in range(8):
                if mask[0] >> o & 1:
                    eight, at = self.take(h, at, 1)
                    require(eight[0] != 0, "chunk SNOD {}: byte {}: an octant without voxels", h, at)
                    bits |= eight[0] << 8 * o
            found[octant] = (("word", bits), 0)
        return found, count, at

    def children(self, h, pointer):
        """(octant, pointer) of what there is in a cell, as it is, in the order of octants."""
        address, mirror = pointer
        require(address in self.begins[h], "chunk SNOD {}: no node begins at byte {}", h, address)
        found, _, _ = self.parse(h, address)
        return sorted((octant ^ mirror, (below, m ^ mirror)) for octant, (below, m) in found.items())

    def count(self, h, pointer):
        return self.parse(h, pointer[0])[1]

    def word(self, pointer):
        address, mirror = pointer
        if isinstance(address, tuple):
            return mirrored(address[1], 4, mirror)
        require(address < len(self.leaves), "chunk LEAF: no word {}", address)
        return mirrored(self.leaves[address], 4, mirror)
