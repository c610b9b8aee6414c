"""index.html: all results on one page that needs no other file, and no network."""
import base64
import html
import json
import os
import struct
import subprocess

from sweep import table
from sweep.failure import Failure
from sweep.runner import pictures

MOST_WIDTH = 960               # pixels of an embedded picture
MOST_PICTURE_BYTES = 48 << 20  # of all of them; beyond, only those of settings on the Pareto front
SCRIPTS = ("state.js", "charts.js", "table.js", "pictures.js")
# Where Chart.js is: beside the modules, or where Debian's package has it.
CHART_FILES = (os.path.join(os.path.dirname(__file__), "chart.min.js"), "/usr/share/javascript/chart.js/chart.min.js")
NAMES = {"percent": "size, %", "bits_per_voxel": "bits per voxel", "psnr_db": "PSNR, dB", "rmse": "RMSE",
         "max_abs_error": "greatest error", "encode_seconds": "encoding, s", "decode_seconds": "decoding, s",
         "file_bytes": "bytes", "grmse": "RMSE of colours", "color_percent": "colours, % of 24 bits",
         "color_bits_per_voxel": "colours, bits per voxel", "snr_db": "SNR, dB",
         "peak_rss_bytes": "peak memory of encoding, bytes", "decode_peak_rss_bytes": "peak memory of decoding, bytes",
         "mean_abs_error": "mean error", "input_mb_per_s": "encoding, MB/s", "levels": "levels", "ratio": "ratio"}
OF_RENDERS = {"ms_avg": "ms a frame", "psnr_db_avg": "PSNR of pictures, dB", "ms_ssim_avg": "MS-SSIM of pictures",
              "mrays_per_s": "million rays/s", "ms_min": "ms, fastest frame", "ms_max": "ms, slowest frame",
              "reference_ms_avg": "ms a frame of the original", "speed_ratio": "speed, original = 1",
              "rmse_avg": "RMSE of pictures"}
USUAL = ["percent", "bits_per_voxel", "psnr_db", "max_abs_error", "encode_seconds", "decode_seconds"]
USUAL_OF_COLORS = ["color_percent", "grmse", "encode_seconds", "decode_seconds"]


def column_names(columns):
    names = dict(NAMES)
    for column in columns:
        start, _, end = column.rpartition(".")
        if column.startswith("param."):
            names[column] = column.removeprefix("param.")
        elif start and end in OF_RENDERS:
            names[column] = f"{start}: {OF_RENDERS[end]}"
    return {column: names[column] for column in columns if column in names}


def usual_columns(flats, columns):
    usual = USUAL_OF_COLORS if table.usual_axes(columns)[0] == "color_percent" else USUAL
    shown = [column for column in usual if column in columns]
    shown += [column for column in columns if column.endswith((".ms_avg", ".psnr_db_avg", ".ms_ssim_avg"))]
    if any(values["status"] != "done" for values in flats):
        shown += ["status", "error"]
    return shown


def width_of(png):
    """Pixels; 0 if it is no PNG."""
    return struct.unpack(">I", png[16:20])[0] if png[:8] == b"\x89PNG\r\n\x1a\n" and len(png) > 24 else 0


class Pictures:
    """Pictures as data URIs, each once."""

    def __init__(self, work, build):
        self.work, self.build = work, build
        self.places, self.numbers = {}, {}  # numbers by URI: pictures of lossless settings are alike; and by file

    def add(self, step):
        """Its number, or None if there is no picture."""
        path = pictures(step, self.work)
        if path not in self.numbers:
            try:
                with open(path, "rb") as file:
                    png = file.read()
            except OSError:
                return None
            if width_of(png) > MOST_WIDTH:
                png = self.scaled(path, png)
            uri = "data:image/png;base64," + base64.b64encode(png).decode()
            self.numbers[path] = self.places.setdefault(uri, len(self.places))
        return self.numbers[path]

    def scaled(self, path, png):
        """At most MOST_WIDTH wide; as it is, where vox-convert cannot do it."""
        width, height = struct.unpack(">II", png[16:24])
        size = f"{MOST_WIDTH},{max(1, round(height * MOST_WIDTH / width))},1"
        small = os.path.join(self.work, f".small-{os.getpid()}-%d.png")
        made = small.replace("%d", "0")
        try:
            program = self.build.program("vox-convert")
            done = subprocess.run([program, path, "-o", small, "--resample", size, "--force", "--quiet"],
                                  stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
            if done.returncode == 0:
                with open(made, "rb") as file:
                    return file.read()
        except (Failure, OSError):
            pass
        finally:
            if os.path.exists(made):
                os.unlink(made)
        return png


def add_pictures(rows, cases, found):
    """Pairs of numbers of pictures, by view, for the rows that are given."""
    for row, case in zip(rows, cases):
        pairs = {}
        for name, step in case.renders.items():
            if name in case.references:
                pair = [found.add(case.references[name]), found.add(step)]
                if None not in pair:
                    pairs[name] = pair
        if pairs:
            row["pictures"] = pairs


def chart_script():
    """Chart.js, or "" where it is not installed."""
    for path in CHART_FILES:
        try:
            with open(path, encoding="utf-8") as file:
                return file.read()
        except OSError:
            continue
    return ""


def read_part(name):
    with open(os.path.join(os.path.dirname(__file__), "page", name), encoding="utf-8") as file:
        return file.read()


def page_text(spec, cases, flats, build, machine, work):
    """The page; `flats` as table.flat made them."""
    columns = table.columns_of(flats)
    rows = [dict(values) for values in flats]
    found = Pictures(work, build)
    total = sum(os.path.getsize(path) for case in cases for step in case.renders.values()
                if os.path.exists(path := pictures(step, work)))
    if total <= MOST_PICTURE_BYTES:
        add_pictures(rows, cases, found)
    else:
        chosen = [(row, case) for row, case in zip(rows, cases) if row["pareto"]]
        add_pictures([row for row, _ in chosen], [case for _, case in chosen], found)
    plots = [{"title": plot.title, "x": table.find_column(plot.x, columns) or plot.x,
              "y": table.find_column(plot.y, columns) or plot.y, "log": "x" * plot.log_x + "y" * plot.log_y,
              "baseline": table.find_column(plot.baseline, columns), "line": plot.line, "inputs": sorted(plot.inputs),
              "codecs": sorted(plot.codecs)}
             for plot in spec.plots]
    data = {"rows": rows, "columns": [column for column in columns if column != "version"], "names": column_names(columns),
            "usual": usual_columns(flats, columns), "axes": table.usual_axes(columns),
            "higher": list(table.HIGHER_IS_BETTER), "plots": plots, "renders": [render.name for render in spec.renders], "machine": machine,
            "version": f"vox-sweep {build.text()}",
            "pictures": list(found.places)}
    # Within a script element only "<" could end it.
    parts = {"TITLE": html.escape(spec.title or "Sweep"), "STYLE": read_part("page.css"), "CHART": chart_script(),
             "SCRIPT": "\n".join(read_part(name) for name in SCRIPTS),
             "DATA": json.dumps(data, ensure_ascii=False).replace("<", "\\u003c")}
    text = read_part("page.html")
    pieces = []
    while "@" in text:
        before, _, rest = text.partition("@")
        name, at, after = rest.partition("@")
        if at and name in parts:
            pieces += [before, parts[name]]
            text = after
        else:
            pieces.append(before + "@")
            text = rest
    return "".join(pieces) + text
