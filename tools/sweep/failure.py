"""What ends the program: one line on standard error, and an exit code that all our programs share."""

NO, USAGE, INPUT, OUTPUT, LIMIT, DEVICE, BUG = 1, 2, 3, 4, 5, 6, 70


class Failure(Exception):
    """`what` is wrong, of `file` where there is one: "FILE: what is wrong: what was expected"."""

    def __init__(self, code, what, file=""):
        super().__init__(what)
        self.code, self.what, self.file = code, what, file

    def line(self):
        return printable(f"{self.file}: {self.what}" if self.file else self.what)


class Interrupted(Exception):
    """A signal asked us to stop."""

    def __init__(self, number):
        super().__init__(f"signal {number}")
        self.number = number


def printable(text):
    """On one line: a file name, or what another program says, may have line feeds."""
    return "".join(" " if c < " " or c == "\x7f" else c for c in text)


def nearest(word, words):
    """The one of `words` that needs the fewest insertions, deletions and substitutions; the first of equals."""
    return min(words, key=lambda candidate: edit_distance(word, candidate))


def edit_distance(a, b):
    row = list(range(len(b) + 1))
    for i, x in enumerate(a):
        diagonal, row[0] = row[0], i + 1
        for j, y in enumerate(b):
            substituted = diagonal + (x != y)
            diagonal = row[j + 1]
            row[j + 1] = min(substituted, row[j] + 1, diagonal + 1)
    return row[-1]
