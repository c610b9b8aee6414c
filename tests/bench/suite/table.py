"""The table that all sections fill: as Markdown while it grows, as a CSV file of all, and as one of what may be committed.

Sizes and errors are the same on every machine with the same versions of the peers, times are not. So `results.csv` has the
former alone, and a change of a codec shows as a change of that file. Rows of data that are not there this time stay in it.
"""
import csv
import dataclasses

from contest import Ratio

FIXED = ["section", "data", "what", "setting", "bytes", "percent", "bits_per_voxel", "psnr_db", "max_error", "grmse", "voxels"]
MEASURED = ["encode_s", "encode_mb_per_s", "encode_ratio", "encode_ratio_least", "encode_ratio_greatest", "encode_peak_mb",
            "decode_s", "decode_mb_per_s", "decode_ratio", "decode_ratio_least", "decode_ratio_greatest", "decode_peak_mb",
            "rate", "rate_unit"]
KEY = FIXED[:4]


@dataclasses.dataclass
class Row:
    section: str
    data: str
    what: str
    setting: str = ""
    fixed: dict = dataclasses.field(default_factory=dict)  # FIXED: sizes and errors
    measured: dict = dataclasses.field(default_factory=dict)  # MEASURED: times and memory

    def key(self):
        return self.section, self.data, self.what, self.setting

    def fields(self, names):
        known = {**dict(zip(KEY, self.key())), **self.fixed, **self.measured}
        return {name: text(known[name]) for name in names if name in known}

    def timed(self, kind, seconds, megabytes, ratio, peak_bytes):
        """Adds what encoding or decoding took; `ratio`, a Ratio, is its time as a multiple of ours."""
        self.measured.update({
            f"{kind}_s": seconds, f"{kind}_mb_per_s": megabytes / seconds, f"{kind}_ratio": ratio.median,
            f"{kind}_ratio_least": ratio.least, f"{kind}_ratio_greatest": ratio.greatest,
            f"{kind}_peak_mb": peak_bytes / 1e6})


    def ratio(self, kind):
        """The ratio that `timed` was given."""
        return Ratio(*(self.measured[f"{kind}_ratio{end}"] for end in ("", "_least", "_greatest")))


def text(value):
    """A figure with six digits, as short as it can be."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def write_csv(path, names, rows):
    beside = path.with_name(path.name + ".part")
    with beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    beside.replace(path)


def read_fixed(path):
    """The rows of a results.csv by their keys; none if there is no file."""
    if not path.exists():
        return {}
    with path.open(newline="", encoding="utf-8") as file:
        return {tuple(row[name] for name in KEY): row for row in csv.DictReader(file)}


def merge_fixed(path, rows):
    """Puts rows with sizes or errors into a results.csv: in the place of those of the same section and data, or sorted in."""
    measured = {(row.section, row.data) for row in rows}
    kept = {key: row for key, row in read_fixed(path).items() if key[:2] not in measured}
    fresh = {row.key(): row.fields(FIXED) for row in rows if row.fixed}
    write_csv(path, FIXED, [row for _, row in sorted({**kept, **fresh}.items())])


class Markdown:
    """A section's table, a line at a time; without columns the note is all of it."""

    def __init__(self, title, note, columns, file):
        self.columns, self.file = columns, file
        self.print(f"\n## {title}\n\n{note}")
        if not columns:
            return
        self.print("\n| " + " | ".join(columns) + " |")
        self.print("| " + " | ".join("---" if i < 3 else "---:" for i in range(len(columns))) + " |")

    def print(self, line):
        print(line, flush=True)
        print(line, file=self.file, flush=True)

    def add(self, *cells):
        self.print("| " + " | ".join(map(str, cells)) + " |")
