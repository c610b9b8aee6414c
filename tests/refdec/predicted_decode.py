"""Predicted colours, from section 4.12 of formats/FORMAT.md alone. For dag_decode.py."""

from container import require
from page_decode import State, decide

SECTION = 65536
KNOTS = [int(k) for k in """
1 2 4 6 10 17 27 45 74 120 194 311 488 747 1102 1546 2048 2550 2994 3349 3608 3785 3902 3976 4022 4051 4069 4079 4086 4090 4092 4094 4095
""".split()]
CLASSES = (0, 1, 2, 3, 4, 6, 8, 11, 15, 20, 28, 40, 60, 90, 140, 220)
WEIGHTS = {1: 6, 2: 2, 3: 1}
AROUND = [(i, j, k) for k in (-1, 0, 1) for j in (-1, 0, 1) for i in (-1, 0, 1) if (i, j, k) != (0, 0, 0)]


def clamp(v, low, high):
    return max(low, min(v, high))


def squash(x):
    x = clamp(x, -2047, 2047)
    i, r = (x + 2048) // 128, (x + 2048) % 128
    return (KNOTS[i] * (128 - r) + KNOTS[i + 1] * r + 64) // 128


STRETCH = []
for least in range(-2047, 2048):
    while len(STRETCH) <= squash(least):
        STRETCH.append(least)
STRETCH += [2047] * (4096 - len(STRETCH))


def class_of(v):
    return sum(most < v for most in CLASSES)


class Decisions:
    """Chances and mixers by name, and the section that is read."""

    def __init__(self):
        self.chances, self.mixers, self.state = {}, {}, None

    def ask(self, name, contexts, mixer):
        """`contexts`: three, each apart for each name."""
        keys = [(name, i, context) for i, context in enumerate(contexts)]
        chances = [self.chances.get(key, (32768, 0)) for key in keys]
        weights = self.mixers.get((name, mixer), (26214, 26214, 26214))
        logs = [STRETCH[p // 16] for p, _ in chances]
        q = squash(sum(w * l for w, l in zip(weights, logs)) >> 16)
        yes = decide(self.state, clamp(q // 2, 1, 2047))
        e, t = 6 * ((4096 if yes else 0) - q), 65535 if yes else 0
        self.mixers[name, mixer] = tuple(clamp(w + (l * e + 32768 >> 16), -1 << 18, 1 << 18) for w, l in zip(weights, logs))
        for key, (p, n) in zip(keys, chances):
            self.chances[key] = p + ((t - p) * (65536 // (n + 2)) >> 16), min(n + 1, 127)
        return yes

    def value(self, number, contexts, few):
        def ask(*name):
            return self.ask((number,) + name, contexts, few)

        if ask("zero"):
            return 0
        negative = ask("sign")
        exponent = 0
        while exponent < 8 and ask("exponent", exponent):
            exponent += 1
        v = 1
        for i in range(exponent):
            if i == 0:
                bit = ask("first", exponent)
            elif i == 1:
                bit = ask("second", exponent, v & 1)
            else:
                bit = decide(self.state, 1024)
            v = 2 * v + bit
        return -v if negative else v


def signed(v):
    return min(abs(v), 7) + (8 if v < 0 else 0)


def decode_predicted(data, places):
    """The colours of a part whose voxels are at `places`, in order."""
    require(len(data) >= 3, "chunk COLR: {} bytes", len(data))
    steps, at = tuple(data[:3]), 3
    require(all(steps) or not any(steps), "chunk COLR: steps {}", steps)
    unit = steps[1] or 2
    decisions, numbers, colors, magnitudes, history = Decisions(), {}, [], [], 0
    for number, (x, y, z) in enumerate(places):
        if number % SECTION == 0:
            require(number == 0 or (decisions.state.value == 1 and not decisions.state.words), "chunk COLR: a section is damaged")
            length = int.from_bytes(data[at:at + 4], "little")
            require(at + 4 <= len(data) and 1 <= length <= len(data) - at - 4, "chunk COLR: a section of {} bytes", length)
            decisions.state = State(data[at + 4:at + 4 + length])
            at += 4 + length
        near, faces = [], 0
        for i, j, k in AROUND:
            other = numbers.get((x + i, y + j, z + k))
            if other is not None:
                axes = (i != 0) + (j != 0) + (k != 0)
                near.append((other, WEIGHTS[axes]))
                if axes == 1:
                    faces |= 1 if i else 2 if j else 4
        n, total = len(near), sum(w for _, w in near)
        contrast = activity = share = 0
        if n:
            p = [(sum(w * colors[o][c] for o, w in near) + total // 2) // total for c in range(3)]
            contrast = class_of(4 * sum(w * sum(abs(colors[o][c] - p[c]) for c in range(3)) for o, w in near) // (total * unit))
            activity = class_of(4 * sum(w * magnitudes[o] for o, w in near) // total)
            share = 1 + 6 * sum(magnitudes[o] > 0 for o, _ in near) // n
        else:
            p = list(colors[-1]) if colors else [128, 128, 128]
        some, few = min(n, 9), min(n, 3)
        lowest = x % 2 + 2 * (y % 2) + 4 * (z % 2)
        k = (0, 0, 0)
        if decisions.ask("expected", ((some, contrast, activity), (history, some, share), (faces, lowest, share)),
                         (some, contrast > 0, activity > 0)):
            history = history << 1 & 63
        else:
            history = (history << 1 | 1) & 63
            red, blue = p[0] - p[1] >> 4, p[2] - p[1] >> 4
            a = decisions.value(0, (activity, contrast, (p[1] // 16, few)), few)
            g = signed(a)
            b = decisions.value(1, ((g, activity), (g, contrast), (g, red)), few)
            r = signed(b)
            c = decisions.value(2, ((g, r), (r, contrast), (r, blue)), few)
            factor = 2 if steps[1] else 1
            k = a + factor * b, a, a + factor * c
        colors.append(tuple(clamp(v + (step or 1) * kc, 0, 255) for v, step, kc in zip(p, steps, k)))
        magnitudes.append(min(255, sum(map(abs, k))))
        numbers[x, y, z] = number
    require(decisions.state.value == 1 and not decisions.state.words, "chunk COLR: a section is damaged")
    require(at == len(data), "chunk COLR: {} bytes behind its sections", len(data) - at)
    return colors
