"""Masks of pages and their models, from section 5.3 of formats/FORMAT.md alone. For packed_decode.py."""

from functools import lru_cache

from container import require
from page_decode import ALONE, BESIDE, Bits, State, decide, read_decisions

CONTEXTS = 8192


class MaskModel:
    def __init__(self, data):
        bits = Bits(data)
        version = bits.get(8)
        require(version in (1, 2), "mask model: unknown version {}", version)
        self.parents = version == 2
        self.solid = read_decisions(bits, CONTEXTS, "mask model")  # of each context, of 2048


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
            solid = decide(state, model.solid[context])
        mask.append(possible and solid)
    require(state.value == 1 and not state.words, "mask: it does not end where its voxels end")
    return mask
