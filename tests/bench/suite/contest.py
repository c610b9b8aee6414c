"""Programs in turn, and by how much one is faster than another.

Whatever else the machine does meets all contestants alike if they run one after the other, round for round. A ratio is made
of every round, and their median is given with the least and the greatest, so that it can be seen what it is worth.
"""
import dataclasses
import statistics

from process import run

LONG = 8  # seconds of a command: fewer rounds of it are enough


@dataclasses.dataclass
class Ratio:
    median: float
    least: float
    greatest: float

    def __str__(self):
        return f"{self.median:.3g} ({self.least:.3g}–{self.greatest:.3g})"


class Contest:
    def __init__(self, rounds=3):
        self.rounds = rounds
        self.runs = {}  # by name: what each round took

    def go(self, commands, between=None):
        """Runs commands, {name: words}, in turn. `between(name)` is called after each first run."""
        commands = dict(commands)
        self.runs = {name: [] for name in commands}
        for number in range(self.rounds):
            for name, words in commands.items():
                done = self.runs[name]
                if number >= 2 and done[0].seconds > LONG:
                    continue
                done.append(run(*words))
                if number == 0 and between:
                    between(name)
        return self

    def seconds(self, name):
        return statistics.median(one.seconds for one in self.runs[name])

    def peak_bytes(self, name):
        return max(one.peak_bytes for one in self.runs[name])

    def ratio(self, name, ours):
        """Time of `name` as a multiple of ours, from the rounds that both ran."""
        return ratio_of([one.seconds for one in self.runs[name]], [one.seconds for one in self.runs[ours]])


def ratio_of(theirs, ours):
    every = [their / our for their, our in zip(theirs, ours)]
    return Ratio(statistics.median(every), min(every), max(every))
