"""Pages and their models, from section 5 of formats/FORMAT.md alone. For packed_decode.py beside this file."""

from bisect import bisect_left
from functools import lru_cache

from container import require

TAPS = ([(t % 3 - 1, t // 3 - 1, -1) for t in range(9)] + [(t - 10, -1, 0) for t in range(9, 12)] +
        [(-1, 0, 0), (-2, 0, 0), (0, -2, 0), (0, 0, -2)])
THRESHOLDS = (1, 2, 3, 4, 5, 6, 7, 8, 11, 15, 20, 27, 37, 49, 67, 90, 122, 164, 222, 299, 404, 546, 737)
MOST = THRESHOLDS[-1]
CONTEXTS = [sum(t <= a for t in THRESHOLDS) for a in range(MOST + 2 * 255 + 1)]  # of an activity, in its 24
ESCAPE = 72
DECISIONS = (1024, 1, 2, 4, 7, 12, 20, 32, 48, 72, 104, 148, 208, 288, 392, 528,
             700, 900, 1148, 1348, 1520, 1656, 1760, 1840, 1900, 1944, 1976, 2000, 2016, 2028, 2041, 2047)
# Neighbours of labels, and the order in which they are asked for their names.
ALONE = ((-1, 0, 0), (-2, 0, 0), (-1, -1, 0), (0, -1, 0), (1, -1, 0), (-1, 0, -1), (0, 0, -1), (1, 0, -1), (0, -2, 0),
         (0, -1, -1), (0, 1, -1), (0, 0, -2))
BESIDE = ((-1, 0, 0), (-1, -1, 0), (0, -1, 0), (1, -1, 0), (-1, 0, -1), (0, 0, -1), (0, -1, -1))
TURNS_ALONE, TURNS_BESIDE = (0, 3, 6, 4, 2, 9, 5, 7, 10), (7, 0, 2, 5, 8, 9, 10, 1, 3, 4, 6)


# ---- Section 5.1: the model ------------------------------------------------------------------------------------------


class Bits:
    def __init__(self, data):
        self.data, self.at = data, 0

    def get(self, count):
        end = self.at + count
        require(end <= 8 * len(self.data), "page model: cut off")
        value = int.from_bytes(self.data[self.at // 8:(end + 7) // 8], "little") >> self.at % 8
        self.at = end
        return value & (1 << count) - 1

    def golomb(self, k):
        window = int.from_bytes(self.data[self.at // 8:self.at // 8 + 9], "little") >> self.at % 8  # 65 bits or more
        zeros = (window & -window).bit_length() - 1
        if window == 0:  # too many zeros, or the end
            zeros = min(33, 8 * len(self.data) - self.at)
        self.get(zeros + 1)
        require(k + zeros <= 32, "page model: a number of {} bits", k + zeros)
        value = (1 << k + zeros) - (1 << k) + self.get(k + zeros)
        require(value < 1 << 32, "page model: number {}", value)
        return value

    def signed_golomb(self, k):
        g = self.golomb(k)
        return -(g + 1) // 2 if g % 2 else g // 2


def read_decisions(bits, count, name):
    """Of each of so many contexts its parts of 2048, to the end of a model (section 5.3)."""
    parts = []
    while len(parts) < count:
        run = bits.golomb(2)
        require(len(parts) + run <= count, "{}: more than {} contexts", name, count)
        parts += [DECISIONS[0]] * run
        if len(parts) < count:
            number = bits.get(5)
            require(number > 0, "{}: the number of a context is 0", name)
            parts.append(DECISIONS[number])
    used = (bits.at + 7) // 8
    require(bits.get(8 * used - bits.at) == 0 and used == len(bits.data), "{}: bits behind its end", name)
    return parts


def counts(parents):
    """Of classes, taps and tables."""
    return (48, 30, 192) if parents else (18, 16, 72)


def lacks(c, tap, parents=False):
    """Whether a class of voxels lacks a tap."""
    if tap >= 16:
        return not parents
    dx, dy, dz = TAPS[tap]
    n = 4 if parents else 3
    px, py = c % n, c // n % n
    return ((dx < 0 and px == 0) or (dx > 0 and px == n - 1) or (dy < 0 and py == 0) or (dy > 0 and py == n - 1) or
            (dz < 0 and c < n * n))


def rest_tap(c, parents=False):
    return next((t for t in (17, 4, 10, 12) if not lacks(c, t, parents)), None)


class Model:
    def __init__(self, data):
        bits = Bits(data)
        version = bits.get(8)
        require(version in (1, 2, 3, 4), "page model: unknown version {}", version)
        self.parents = version in (2, 4)
        self.labels = None
        if version > 2:
            self.read_labels(bits)
            return
        self.has_palette = bits.get(1)
        self.most, self.bound, self.background = bits.get(32), bits.golomb(0), bits.golomb(8)
        require(self.bound <= (1 << 31) - 2, "page model: bound {}", self.bound)
        require(self.background <= self.most, "page model: background {} above {}", self.background, self.most)
        self.palette = None
        if self.has_palette:
            require(self.most < 1 << 18 and self.bound == 0, "page model: a palette of {}, bound {}", self.most + 1,
                    self.bound)
            self.palette, entry = [], -1
            for _ in range(self.most + 1):
                entry += 1 + bits.golomb(2)
                require(entry < 1 << 32, "page model: entry {} of the palette", entry)
                self.palette.append(entry)
        self.greatest_sample = self.palette[-1] if self.has_palette else self.most
        self.wide = self.most >= 1 << 16
        self.value_bytes = 1 if self.most < 1 << 8 else 2 if self.most < 1 << 16 else 4
        classes, _, tables = counts(self.parents)
        self.weights = [self.read_weights(bits, c, self.parents) for c in range(classes)]
        self.tables = []
        for context in range(tables):
            same = bits.get(1)
            require(not same or context > 0, "page model: the first table is as the one before")
            self.tables.append(self.tables[-1] if same else self.read_table(bits))
        used = (bits.at + 7) // 8
        require(bits.get(8 * used - bits.at) == 0 and used == len(data), "page model: bits behind its end")
        self.palette = self.palette or range(self.most + 1)

    def read_labels(self, bits):
        """Section 5.4."""
        self.most, self.background, self.bound, self.wide, self.has_palette = bits.get(16), bits.get(16), 0, False, 0
        require(self.background <= self.most, "page model: background {} above {}", self.background, self.most)
        self.greatest_sample, self.palette = self.most, range(self.most + 1)
        self.value_bytes = 1 if self.most < 1 << 8 else 2
        self.labels = read_decisions(bits, 16384 if self.parents else 8192, "page model")

    def nearest(self, sample):
        """The value that a parent has."""
        if not self.has_palette:
            return min(sample, self.most)
        above = bisect_left(self.palette, sample)
        if above == 0 or above > self.most:
            return min(above, self.most)
        return above - 1 if sample - self.palette[above - 1] <= self.palette[above] - sample else above

    @staticmethod
    def read_weights(bits, c, parents):
        """Pairs of taps and weights."""
        rest = rest_tap(c, parents)
        taps = range(counts(parents)[1])
        weights = {t: bits.signed_golomb(7) for t in taps if not lacks(c, t, parents) and t != rest}
        if rest is not None:
            weights[rest] = 4096 - sum(weights.values())
        require(all(-32767 <= w <= 32767 for w in weights.values()) and sum(map(abs, weights.values())) <= 65535,
                "page model: weights of class {}", c)
        return [(t, w) for t, w in weights.items() if w]

    @staticmethod
    def read_table(bits):
        """The symbol of each of 2048 slots, with its first slot and its part."""
        count = bits.get(7)
        require(count <= 72, "page model: a table of {} symbols", count)
        parts, before = [], 512
        for _ in range(count):
            before = bits.golomb(max(0, before.bit_length() - 2))
            parts.append(before)
        require(sum(parts) < 2048 and (not parts or parts[-1]), "page model: a table that adds up to {}", sum(parts))
        parts += [0] * (72 - count) + [2048 - sum(parts)]
        slots = []
        for symbol, part in enumerate(parts):
            slots += [(symbol, len(slots), part)] * part
        return slots


# ---- Section 5.2: a page ---------------------------------------------------------------------------------------------


class State:
    def __init__(self, page):
        size = len(page)
        cut = size if size <= 8 else 5 + (size - 5) % 4
        self.value, self.words = int.from_bytes(page[:cut], "little"), page[cut:]

    def renew(self):
        if self.value < 1 << 32 and self.words:
            self.value = self.value << 32 | int.from_bytes(self.words[-4:], "little")
            self.words = self.words[:-4]

    def take(self, count):
        taken = self.value & (1 << count) - 1
        self.value >>= count
        return taken

    def symbol(self, slots):
        symbol, first, part = slots[self.value % 2048]
        self.value = self.value // 2048 * part + self.value % 2048 - first
        return symbol

    def folded(self, slots, wide):
        s = self.symbol(slots)
        base, count = s, 0
        if s == ESCAPE:
            base, count = 0, 32 if wide else 17
        elif s >= 16:
            count = 3 + (s - 16) // 2
            base = 2 + s % 2 << count
        if not wide:
            base += self.take(count)
        else:
            low = min(count, 16)
            self.renew()
            base += self.take(low)
            self.renew()
            base += self.take(count - low) << low
        self.renew()
        return base


@lru_cache(maxsize=256)
def places(shape, parents):
    """Of each voxel of a page of this shape, in order: its class, where its taps are, of which sets of values its range
    is, where its activity comes from (eight times), the voxel before (None if it has none), and its first table.
    `parents`: None, or the shape of their page and where in it those of the page begin; they stand before the voxels."""
    X, Y, Z = shape
    skip = parents[0][0] * parents[0][1] * parents[0][2] if parents else 0

    def index(point, shape):
        x, y, z = (min(max(i, 0), n - 1) for i, n in zip(point, shape))
        return (z * shape[1] + y) * shape[0] + x

    def at(x, y, z):
        return skip + index((x, y, z), shape)

    def place(i, n):
        if parents:
            return 0 if i == 0 else 3 if i == n - 1 else 1 + i % 2
        return 0 if i == 0 else 2 if i == n - 1 else 1

    def parent(voxel, *distance):
        return index([c + i // 2 + d for c, i, d in zip(parents[1], voxel, distance)], parents[0])

    out = []
    for z in range(Z):
        for y in range(Y):
            u = (y - 1, z) if y > 0 else (y, z - 1)
            b = (y, z - 1) if z > 0 else (y - 1, z)
            ty, tz = 2 * (y % 2) - 1, 2 * (z % 2) - 1
            for x in range(X):
                taps = [at(x + dx, y + dy, z + dz) for dx, dy, dz in TAPS]
                spans, near = [], ()
                if y > 0 or z > 0:
                    spans = [taps[0 if z > 0 else 9:12 if y > 0 else 9]]
                    near = tuple(at(x + dx, *row) for row in (u, b) for dx in (-1, 0, 0, 1))
                if parents:
                    own = parent((x, y, z), 0, 0, 0)
                    taps += [parent((x, y, z), dx, dy, dz) for dz in (0, tz) for dy in (0, ty) for dx in (-1, 0, 1)]
                    taps += [parent((x, y, z), 0, -ty, 0), parent((x, y, z), 0, 0, -tz)]
                    around = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
                    spans = [(spans[0] if spans else []) + [own], [own] + [parent((x, y, z), *d) for d in around]]
                    c = place(x, X) + 4 * place(y, Y) + 16 * (0 if z == 0 else 1 + z % 2)
                    first = 24 * (4 * (z % 2) + 2 * (y % 2) + x % 2)
                else:
                    c = place(x, X) + 3 * place(y, Y) + (9 if z > 0 else 0)
                    first = 0 if z == 0 else 24 if y == 0 else 48
                out.append((c, taps, spans, near, at(x - 1, y, z) if x > 0 else None, first))
    return out


def decode_page(model, page, shape, parents=None, mask=None):
    """The samples of a page of `shape` voxels, x fastest. `parents`, of a model that has them: the samples of their
    page, its shape, and where in it those of this page begin. `mask`, of a page that has one: of each voxel whether it
    is solid."""
    count = shape[0] * shape[1] * shape[2]
    require(mask is None or not model.wide, "page: a mask beside a wide model")
    if len(page) <= model.value_bytes:
        require(len(page) in (0, model.value_bytes), "page: {} bytes, expected {}", len(page), model.value_bytes)
        value = int.from_bytes(page, "little") if page else model.background
        require(value <= model.most, "page: value {} above {}", value, model.most)
        return [model.palette[value]] * count

    if model.labels:
        require(mask is None, "page: a mask beside a model of labels")
        return decode_labels(model, State(page), shape, parents)
    # Parents, then the voxels of the page.
    values = [model.nearest(sample) for sample in parents[0]] if model.parents else []
    skip, state, magnitudes = len(values), State(page), [0] * len(values)
    step = 2 * model.bound + 1
    shape_of_parents = parents[1:] if model.parents else None
    for (c, taps, spans, near, left, table), solid in zip(places(shape, shape_of_parents), mask or [True] * count):
        first = not values  # of all, without parents
        # 1. Prediction.
        total = 4096 * model.background if first else sum(weight * values[taps[t]] for t, weight in model.weights[c])
        predicted = min(max((total + 2047) // 4096, 0), model.most)
        if not solid:
            values.append(predicted)
            magnitudes.append(0)
            continue
        mirrored = (total + 2047) % 4096 >= 2048
        # 2. Context.
        shares = 0
        for span in spans:
            around = [values[at] for at in span]
            shares += min((max(around) - min(around)) * (32768 // step) >> 16, 1023)
        activity = sum([magnitudes[at] for at in near]) + shares // max(len(spans), 1)
        activity = MOST if first else min(activity, MOST)
        if left is not None:
            activity += 2 * magnitudes[left]
        elif near:
            activity = min(activity + 2 * magnitudes[near[1]], MOST)
        # 3. Symbol.
        folded = state.folded(model.tables[CONTEXTS[activity] + table], model.wide)
        # 4. Value.
        size = (folded + 1) // 2
        value = predicted + (-size if folded % 2 != mirrored else size) * step
        if model.wide and model.bound == 0:
            value %= 1 << 32
        values.append(min(max(value, 0), model.most))
        magnitudes.append(min(size, 255))
    require(state.value == 1 and not state.words, "page: it does not end where its voxels end")
    return [model.palette[value] for value in values[skip:]]


# ---- Section 5.4: labels ---------------------------------------------------------------------------------------------


def decide(state, q):
    """Whether it is the first of two, which has q parts of 2048."""
    rest = state.value % 2048
    first = rest < q
    state.value = state.value // 2048 * (q if first else 2048 - q) + (rest if first else rest - q)
    state.renew()
    return first


def decode_labels(model, state, shape, parents):
    values = {}  # by place

    def parent_at(point):
        samples, (X, Y, Z), _ = parents
        if not (0 <= point[0] < X and 0 <= point[1] < Y and 0 <= point[2] < Z):
            return None
        sample = samples[(point[2] * Y + point[1]) * X + point[0]]
        return sample if sample <= model.most else None

    for z in range(shape[2]):
        for y in range(shape[1]):
            for x in range(shape[0]):
                known = [values.get((x + dx, y + dy, z + dz)) for dx, dy, dz in (BESIDE if model.parents else ALONE)]
                if model.parents:
                    own = [c + i // 2 for c, i in zip(parents[2], (x, y, z))]
                    known.append(parent_at(own))
                    for axis, i in enumerate((x, y, z)):
                        known.append(parent_at([p + (2 * (i % 2) - 1) * (a == axis) for a, p in enumerate(own)]))
                asked = []
                for turn in TURNS_BESIDE if model.parents else TURNS_ALONE:
                    name = known[turn]
                    if name is None or name in asked:
                        continue
                    context = sum(1 << i for i, other in enumerate(known) if other == name)
                    if model.parents:
                        context += (4 * (z % 2) + 2 * (y % 2) + x % 2) << 11
                    elif asked:
                        context += 1 << 12
                    asked.append(name)
                    if decide(state, model.labels[context]):
                        break
                else:
                    name = min(state.take(model.most.bit_length()), model.most)
                    state.renew()
                values[x, y, z] = name
    require(state.value == 1 and not state.words, "page: it does not end where its voxels end")
    return [values[x, y, z] for z in range(shape[2]) for y in range(shape[1]) for x in range(shape[0])]
