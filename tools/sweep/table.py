"""Results as rows: one for each setting of each input, as JSON with everything and as a table of numbers and words."""
import csv
import io
import json

HIGHER_IS_BETTER = ("psnr_db", "snr_db", "ssim", "ms_ssim", "psnr_db_avg", "ms_ssim_avg", "ratio", "input_mb_per_s",
                    "mrays_per_s", "speed_ratio")
# What differs from run to run and machine to machine.
TIMES = ("seconds", "ms_min", "ms_avg", "ms_max", "_mb_per_s", "mrays_per_s", "peak_rss_bytes", "speed_ratio")
FIRST = ["input", "codec", "setting", "status", "error", "pareto"]
# Of an encoder's result: what is in other columns, or says nothing.
LEFT_OUT = {"schema", "tool", "input", "output", "params", "a", "b", "passed", "histogram", "frames", "reference", "peak",
            "voxels", "device", "mode", "traversal"}


def is_time(column):
    return column.endswith(TIMES)


def result(records, step):
    record = records.find(step) if step else None
    return record.get("result") if record else None


def rows_of(cases, records, build, machine):
    """Objects of results.jsonl, in the order of the cases."""
    rows = []
    for case in cases:
        steps = case.steps()
        found = [records.find(step) for step in steps]
        errors = [record["error"] for record in found if record and record["status"] == "failed"]
        row = {"schema": 1, "tool": "vox-sweep", "version": build.text(), "case": case.name, "input": case.input.name,
               "codec": case.codec.name, "encoder": case.codec.tool, "setting": case.setting(), "options": dict(case.options),
               "status": "failed" if errors else "done" if None not in found else "missing",
               "error": errors[0] if errors else None, "pareto": False,
               "encode": result(records, case.encode), "decode": result(records, case.decode),
               "compare": result(records, case.compare),
               "renders": {name: result(records, step) for name, step in case.renders.items()},
               "commands": {step.name: step.shown() for step in steps},
               "process_seconds": {step.kind: record["seconds"] for step, record in zip(steps, found)
                                   if record and step.kind != "reference"},
               "machine": machine}
        rows.append(row)
    flats = [flat(row) for row in rows]
    for name in {row["input"] for row in rows}:
        of_input = [(row, values) for row, values in zip(rows, flats) if row["input"] == name]
        error = usual_axes({key for _, values in of_input for key in values})[1]
        for index in front([(values.get("file_bytes"), distortion(values, error)) for _, values in of_input]):
            of_input[index][0]["pareto"] = True
    return rows


def usual_axes(columns):
    """The columns of size and error that are looked at first: of colours alone, where there was no other comparison."""
    if "psnr_db" not in columns and "grmse" in columns:
        return "color_percent", "grmse"
    return "bits_per_voxel", "psnr_db"


def distortion(values, column):
    """Less is better."""
    error = number(values.get(column))
    return -error if error is not None and higher_is_better(column) else error


def number(value):
    """A float, infinity too; None if it is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    try:
        return float(value)
    except ValueError:
        return None


def front(points):
    """Indices of the points (x, y) that no other one beats: less or equal in both, and less in one."""
    order = sorted((p[0], p[1], i) for i, p in enumerate(points) if None not in p)
    best, indices = None, []
    for x, y, i in order:
        if best is None or y < best[1] or (x, y) == best:
            indices.append(i)
            best = (x, y)
    return indices


def scalars(result_object, prefix=""):
    """What fits into a cell; lists of numbers as 1x2x3, other lists by their length."""
    values = {}
    for key, value in (result_object or {}).items():
        if key in LEFT_OUT:
            continue
        if isinstance(value, list):
            plain = all(isinstance(item, int) for item in value)
            value = "x".join(map(str, value)) if key == "dims" and plain else len(value) if key != "transform_share" else None
        if isinstance(value, (int, float, str)):
            values[prefix + key] = value
    return values


def flat(row):
    """The cells of a row, by column."""
    values = {key: row[key] for key in FIRST}
    values["error"] = row["error"] or ""
    values |= {f"param.{key}": value for key, value in row["options"].items()}
    values |= scalars(row["encode"])
    if row["decode"]:
        values["decode_seconds"] = row["decode"].get("decode_seconds")
        values["decode_peak_rss_bytes"] = row["decode"].get("peak_rss_bytes")
    # dagcolor-pack's error of colours is that of its voxels, voxdiff's that of the whole volume, which is mostly void.
    known = ("dims", "voxel_format", "version") + (("grmse", "grmse_distance") if "grmse" in values else ())
    values |= {key: value for key, value in scalars(row["compare"]).items() if key not in known}
    for name, rendered in row["renders"].items():
        cells = scalars(rendered, f"{name}.")
        reference = (rendered or {}).get("reference") or {}
        if "ms_avg" in reference:
            cells[f"{name}.reference_ms_avg"] = reference["ms_avg"]
        values |= {key: value for key, value in cells.items() if not key.endswith((".version", ".threads"))}
    return values


def columns_of(flats):
    """All columns: what names a setting, its options, then the rest in the order in which programs print them."""
    names = list(dict.fromkeys(key for values in flats for key in values))
    rest = [name for name in names if name not in FIRST]
    return FIRST + [name for name in rest if name.startswith("param.")] + \
        [name for name in rest if not name.startswith("param.") and "." not in name and name != "version"] + \
        [name for name in rest if "." in name and not name.startswith("param.")] + ["version"]


def csv_text(flats):
    file = io.StringIO()
    columns = columns_of(flats)
    writer = csv.DictWriter(file, columns, restval="", lineterminator="\n")
    writer.writeheader()
    for values in flats:
        writer.writerow({key: str(value).lower() if isinstance(value, bool) else value for key, value in values.items()})
    return file.getvalue()


def jsonl_text(rows):
    return "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in rows)


def find_column(name, columns):
    """The column that is meant: its own name, or a part that only one has, such as psnr for psnr_db; None if there is none."""
    if not name:
        return None
    for candidate in (name, f"{name}_db", f"param.{name}"):
        if candidate in columns:
            return candidate
    ends = [column for column in columns if column.endswith(f".{name}")]
    return ends[0] if len(ends) == 1 else None


def higher_is_better(column):
    return column.rsplit(".", 1)[-1] in HIGHER_IS_BETTER
