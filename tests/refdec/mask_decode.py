"""Masks of pages and their models, from section 5.3 of formats/FORMAT.md alone. For packed_decode.py."""

from functools import lru_cache

from container import require
from page_decode import Bits, State

CONTEXTS = 8192
SOLID = (1024, 1, 2, 4, 7, 12, 20, 32, 48, 72, 104, 148, 208, 288, 392, 528,
         700, 900, 1148, 1348, 1520, 1656, 1760, 1840, 1900, 1944, 1976, 2000, 2016, 2028, 2041, 2047)
# The voxels that a context looks at, from bit 0 on.
ALONE = ((-1, 0, 0), (-2, 0, 0), (-1, -1, 0), (0, -1, 0), (1, -1, 0), (-1, 0, -1), (0, 0, -1), (1, 0, -1), (0, -2, 0),
         (0, -1, -1), (0, 1, -1), (0, 0, -2))
BESIDE = ((-1, 0, 0), (-1, -1, 0), (0, -1, 0), (1, -1, 0), (-1, 0, -1), (0, 0, -1), (0, -1, -1))


class MaskModel:
    def __init__(self, data):
        bits = Bits(data)
        version = bits.get(8)
        require(version in (1, 2), "mask model: unknown version {}", version)
        self.parents = version == 2
        self.solid = []  # of each context, of 2048
        while len(self.solid) < CONTEXTS:
            run = bits.golomb(2)
            require(len(self.solid) + run <= CONTEXTS, "mask model: more than {} contexts", CONTEXTS)
            self.solid += [SOLID[0]] * run
            if len(self.solid) < CONTEXTS:
                number = bits.get(5)
                require(number > 0, "mask model: the number of a context is 0")
                self.solid.append(SOLID[number])
        used = (bits.at + 7) // 8
        require(bits.get(8 * used - bits.at) == 0 and used == len(data), "mask model: bits behind its end")


@lru_cache(maxsize=64)
def places(shape, parents):
    """Of each voxel of a page of this shape, in order: its parent, and a constant and the voxels of which its context
    is, those of the page and those of the parents, each with its bit. `parents`: None, or the shape of their page and
    where in it those of the page begin."""

    def inside(points, shape, bit):
        for (x, y, z), b in zip(points, range(bit, 13)):
            if 0 <= x < shape[0] and 0 <= y < shape[1] and 0 <= z < shape[2]:
                yield (z * shape[1] + y) * shape[0] + x, 1 << b

    out = []
    for z in range(shape[2]):
        for y in range(shape[1]):
            for x in range(shape[0]):
                before = [(x + dx, y + dy, z + dz) for dx, dy, dz in (BESIDE if parents else ALONE)]
                own, above, parent = tuple(inside(before, shape, 0)), (), None
                constant = 4096 if z > 0 else 0
                if parents:
                    i, j, k = (c + p // 2 for c, p in zip(parents[1], (x, y, z)))
                    d = [2 * (p % 2) - 1 for p in (x, y, z)]
                    above = tuple(inside(((i + d[0], j, k), (i, j + d[1], k), (i, j, k + d[2])), parents[0], 7))
                    parent = (k * parents[0][1] + j) * parents[0][0] + i
                    constant = (4 * (z % 2) + 2 * (y % 2) + x % 2) << 10
                out.append((parent, constant, own, above))
    return out


def decode_mask(model, page, shape, parents=None):
    """Of each voxel of a page of `shape` voxels whether it is solid. `parents`, of a model that has them: the mask of
    their page, its shape, and where in it those of this page begin."""
    if not page:
        return [False] * (shape[0] * shape[1] * shape[2])
    where = places(shape, parents[1:] if model.parents else None)
    may = [not model.parents or parents[0][parent] for parent, *_ in where]
    if len(page) == 1:
        require(page[0] == 1, "mask: byte {}, expected 1", page[0])
        return may
    mask, state = [], State(page)
    for possible, (_, context, own, above) in zip(may, where):
        if possible:
            context += sum(bit for at, bit in own if mask[at]) + sum(bit for at, bit in above if parents[0][at])
            q, rest = model.solid[context], state.value % 2048
            solid = rest < q
            state.value = state.value // 2048 * (q if solid else 2048 - q) + (rest if solid else rest - q)
            state.renew()
        mask.append(possible and solid)
    require(state.value == 1 and not state.words, "mask: it does not end where its voxels end")
    return mask
