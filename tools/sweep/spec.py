"""Reads what to run. README.md describes the file; everything in it is checked here, but for the values of options,
which are checked by the programs that they are options of."""
import dataclasses
import itertools
import json
import math
import os
import re
import sys

from sweep.failure import Failure, INPUT, LIMIT, USAGE, nearest

MOST_BYTES = 16 << 20
MOST_SETTINGS = 100_000  # of all inputs and codecs together
MOST_VALUES = 10_000     # of one option
ENDINGS = {"svmm-encode": ".svmm", "vq-encode": ".vqv", "dagcolor-pack": ".dagc"}
# Options that a sweep gives itself.
OURS = {"help", "version", "output", "json", "force", "quiet", "verbose", "progress", "max-memory"}
OURS_OF_RENDERS = OURS | {"reference", "report", "aov"}


@dataclasses.dataclass(frozen=True)
class Input:
    name: str
    file: str
    options: tuple      # pairs (name, value), as all options here
    reference: str      # what results are compared with: a file, a built-in, or "" for the input itself
    there: bool = True  # false: is in a folder of data that was not given


@dataclasses.dataclass(frozen=True)
class Codec:
    name: str
    tool: str
    settings: tuple     # of tuples of options
    inputs: frozenset   # names


@dataclasses.dataclass(frozen=True)
class Render:
    name: str
    options: tuple
    inputs: frozenset
    codecs: frozenset
    compare: bool       # with the picture of the original


@dataclasses.dataclass(frozen=True)
class Plot:
    name: str
    title: str
    x: str
    y: str
    log_x: bool
    log_y: bool
    label: tuple        # options whose values stand beside points
    line: str           # "front": joins the points of a codec that none of its others beats; "all" of them; "none"
    fit: str            # "" or "power": y = a x^b through all points of a codec
    baseline: str       # "", or a column whose median is shown beside y
    inputs: frozenset   # names
    codecs: frozenset   # names


@dataclasses.dataclass(frozen=True)
class Spec:
    title: str
    folder: str         # of the file: relative names begin there
    inputs: tuple
    codecs: tuple
    renders: tuple
    plots: tuple
    decode: bool        # time the decoding
    metrics: tuple | None  # options of voxdiff; None: do not compare
    threads: int        # of each program; 0: all
    timeout: float      # seconds a program may take; 0: for ever
    repeat: int         # times that encoders, decoders and renders run; the fastest counts
    keep: bool          # compressed files, after they have served
    left_out: tuple = ()  # names of inputs whose folder was not given


def is_surface(file):
    """Whether it has no voxels until dagcolor-pack has made them."""
    return file.endswith((".obj", ".gltf", ".glb", ".ply", ".stl", ".3ds", ".pcd", ".las", ".vox")) or file.startswith("terrain:")


class Place:
    """A value of the file and where it is, for messages."""

    def __init__(self, file, path, value):
        self.file, self.path, self.value = file, path, value

    def fail(self, what, code=INPUT):
        raise Failure(code, f"{self.path}: {what}" if self.path else what, self.file)

    def member(self, key):
        return Place(self.file, f"{self.path}.{key}" if self.path else key, self.value[key])

    def items(self):
        """Of a list."""
        if not isinstance(self.value, list):
            self.fail("expected a list")
        return [Place(self.file, f"{self.path}[{i}]", value) for i, value in enumerate(self.value)]

    def members(self, known, needed=()):
        """Of an object: a dictionary of places; no other keys than the known ones."""
        if not isinstance(self.value, dict):
            self.fail(f"expected an object with {', '.join(known)}" if known else "expected an object")
        for key in self.value:
            if known and key not in known:
                self.fail(f'unknown key "{key}": did you mean "{nearest(str(key), known)}"?')
        for key in needed:
            if key not in self.value:
                self.fail(f'"{key}" is missing')
        return {key: self.member(key) for key in self.value}

    def text(self):
        if not isinstance(self.value, str) or not self.value or not self.value.isprintable():
            self.fail("expected a text")
        return self.value

    def boolean(self):
        if not isinstance(self.value, bool):
            self.fail("expected true or false")
        return self.value

    def number(self, least, greatest, whole=False):
        kinds = int if whole else (int, float)
        if isinstance(self.value, bool) or not isinstance(self.value, kinds) or not least <= self.value <= greatest:
            self.fail(f"expected a {'whole ' if whole else ''}number from {least} to {greatest}")
        return self.value


def read(name, option_names, data=""):
    """The Spec in a file; "-" is standard input. `option_names` says which options a program has. `data`: the folder of
    the inputs that are marked so; without it the spec has the others only."""
    value = load(name)
    place = Place("standard input" if name == "-" else name, "", value)
    top = place.members(["inputs", "codecs", "renders", "metrics", "decode", "plots", "threads", "timeout", "repeat",
                         "keep", "title"],
                        ["inputs", "codecs"])
    inputs = named(place, top["inputs"], [read_input(item, option_names, data) for item in top["inputs"].items()])
    codecs = named(place, top["codecs"], [read_codec(item, inputs, option_names) for item in top["codecs"].items()])
    renders = [render for item in (top["renders"].items() if "renders" in top else [])
               for render in read_renders(item, inputs, codecs, option_names)]
    if renders:
        named(place, top["renders"], renders)
    spec = Spec(
        title=top["title"].text() if "title" in top else "",
        folder=os.getcwd() if name == "-" else os.path.dirname(os.path.abspath(name)),
        inputs=tuple(inputs), codecs=tuple(codecs), renders=tuple(renders),
        plots=tuple(read_plots(top["plots"], inputs, codecs)) if "plots" in top else (),
        decode=top["decode"].boolean() if "decode" in top else True,
        metrics=read_metrics(top["metrics"], option_names) if "metrics" in top else (),
        threads=top["threads"].number(0, 4096, whole=True) if "threads" in top else 0,
        timeout=top["timeout"].number(0, 10**9) if "timeout" in top else 0,
        repeat=top["repeat"].number(1, 1000, whole=True) if "repeat" in top else 1,
        keep=top["keep"].boolean() if "keep" in top else False)
    there = {entry.name for entry in inputs if entry.there}
    if not there:
        top["inputs"].fail("all of them are in a folder of data: expected --data DIR", USAGE)
    spec = dataclasses.replace(spec, inputs=tuple(entry for entry in inputs if entry.there),
                               left_out=tuple(entry.name for entry in inputs if not entry.there))
    settings = sum(len(codec.settings) * len(codec.inputs & there) for codec in codecs)
    if settings > MOST_SETTINGS:
        place.fail(f"{settings} settings: expected at most {MOST_SETTINGS}", LIMIT)
    return spec


def load(name):
    """The JSON or YAML of a file, as Python has it."""
    is_yaml = name.endswith((".yaml", ".yml"))
    try:
        if name == "-":
            data = sys.stdin.buffer.read(MOST_BYTES + 1)
        else:
            with open(name, "rb") as file:
                data = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise Failure(INPUT, error.strerror, name) from None
    name = "standard input" if name == "-" else name
    if len(data) > MOST_BYTES:
        raise Failure(LIMIT, f"is too large: expected at most {MOST_BYTES >> 20} MiB", name)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise Failure(INPUT, f"no text at byte {error.start}: expected UTF-8", name) from None
    try:
        return load_yaml(text, name) if is_yaml else load_json(text, name)
    except RecursionError:
        raise Failure(INPUT, "is too deeply nested: expected lists of objects", name) from None


def load_json(text, name):
    def no_duplicates(pairs):
        keys = dict(pairs)
        if len(keys) < len(pairs):
            names = [key for key, _ in pairs]
            twice = next(key for key in names if names.count(key) > 1)
            raise Failure(INPUT, f'"{twice}" is there twice: expected each key once', name)
        return keys

    def no_constant(word):
        raise Failure(INPUT, f"{word}: expected a number", name)

    try:
        return json.loads(text, object_pairs_hook=no_duplicates, parse_constant=no_constant)
    except json.JSONDecodeError as error:
        raise Failure(INPUT, f"no JSON in line {error.lineno}, column {error.colno}: {error.msg}", name) from None
    except ValueError:  # a number of thousands of digits
        raise Failure(INPUT, "a number is too long", name) from None


def load_yaml(text, name):
    try:
        import yaml
    except ImportError:
        raise Failure(INPUT, "YAML cannot be read here: expected the package python3-yaml, or JSON", name) from None

    class Loader(yaml.SafeLoader):
        """A key twice is an error, as in JSON. Aliases are none of JSON, and could be used to make 2^64 values of a page."""

        # Words are what they are in JSON: 012, 1:30, on and no are texts.
        yaml_implicit_resolvers = {}

        def compose_node(self, parent, index):
            if self.check_event(yaml.events.AliasEvent):
                mark = self.peek_event().start_mark
                raise Failure(INPUT, f"an alias in line {mark.line + 1}: expected values", name)
            return super().compose_node(parent, index)

        def construct_mapping(self, node, deep=False):
            keys = [self.construct_object(key, deep=True) for key, _ in node.value]
            for key in keys:
                if not isinstance(key, str) or keys.count(key) > 1:
                    what = "is there twice" if isinstance(key, str) else "is no text: use quotes"
                    raise Failure(INPUT, f'"{key}" in line {node.start_mark.line + 1} or below {what}', name)
            return super().construct_mapping(node, deep)

    for tag, pattern, first in (("null", r"null|~|", "n~"), ("bool", r"true|false", "tf"),
                                ("int", r"-?(0|[1-9][0-9]{0,17})", "-0123456789"),
                                ("float", r"-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][-+]?[0-9]+)?", "-0123456789")):
        Loader.add_implicit_resolver(f"tag:yaml.org,2002:{tag}", re.compile(f"^(?:{pattern})$"), list(first) + ([""] if tag == "null" else []))
    try:
        return yaml.load(text, Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" in line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise Failure(INPUT, f"no YAML{where}: {getattr(error, 'problem', None) or 'unreadable'}", name) from None


def named(top, place, things):
    """Of all things of one kind: some, and no two of one name."""
    if not things:
        place.fail("expected at least one")
    for thing in things:
        if [other.name for other in things].count(thing.name) > 1:
            place.fail(f'two are called "{thing.name}": expected a "name" that no other has')
    return things


def checked_name(place):
    name = place.text()
    if len(name) > 100 or name.strip() != name:
        place.fail("expected a name of at most 100 characters")
    return name


def column_name(place):
    """As part of the name of a column, which conditions name."""
    name = checked_name(place)
    if re.search(r"[<>=,]", name):
        place.fail("expected a name without < > = and commas")
    return name


def checked_file(place):
    file = place.text()
    if file.startswith("-"):
        place.fail(f'"{file}": expected a file or a built-in, which can be read again and again')
    return file


def read_input(place, option_names, data):
    if isinstance(place.value, str):
        file = checked_file(place)
        return Input(default_name(file), file, (), "")
    keys = place.members(["name", "input", "options", "reference", "data"], ["input"])
    file = checked_file(keys["input"])
    name = checked_name(keys["name"]) if "name" in keys else default_name(file)
    of_data = "data" in keys and keys["data"].boolean()
    if of_data and data:
        file = os.path.join(os.path.abspath(data), file)
    options = read_options(keys["options"], option_names("vox-render"), OURS, "vox-render") if "options" in keys else ()
    return Input(name, file, options, checked_file(keys["reference"]) if "reference" in keys else "", bool(data) or not of_data)


def default_name(file):
    """menger:3 is its own name, volumes/head.nii.gz is head."""
    base = os.path.basename(file.rstrip("/")) or file
    stem = base if ":" in base else re.sub(r"(\.gz)?$", "", base).rsplit(".", 1)[0]
    return (stem or base)[:100]


def read_codec(place, inputs, option_names):
    keys = place.members(["name", "tool", "options", "inputs"], ["tool"])
    tool = keys["tool"].text()
    if tool not in ENDINGS:
        keys["tool"].fail(f'"{tool}": expected {", ".join(ENDINGS)}')
    settings = [()]
    if "options" in keys:
        grids = keys["options"].items() if isinstance(keys["options"].value, list) else [keys["options"]]
        if not grids:
            keys["options"].fail("expected at least one object")
        settings = [setting for grid in grids for setting in read_grid(grid, option_names(tool), OURS, tool)]
    unique = list(dict.fromkeys(settings))
    return Codec(checked_name(keys["name"]) if "name" in keys else tool, tool, tuple(unique),
                 read_names(keys, "inputs", inputs))


def read_names(keys, key, things):
    """The names of some of `things`; all, where none are given."""
    names = [thing.name for thing in things]
    if key not in keys:
        return frozenset(names)
    for item in keys[key].items():
        if item.text() not in names:
            item.fail(f'there is no "{item.value}": did you mean "{nearest(item.value, names)}"?')
    if not keys[key].value:
        keys[key].fail("expected at least one")
    return frozenset(keys[key].value)


def read_renders(place, inputs, codecs, option_names):
    """One for each combination of its options."""
    keys = place.members(["name", "options", "inputs", "codecs", "compare"])
    name = column_name(keys["name"]) if "name" in keys else "render"
    grid = [()]
    if "options" in keys:
        grid = read_grid(keys["options"], option_names("vox-render"), OURS_OF_RENDERS, "vox-render")
    varied = {option for setting in grid for option in setting if not all(option in other for other in grid)}
    for setting in grid:
        ending = "".join(f" {key}={value}" for key, value in setting if (key, value) in varied)
        yield Render(name + re.sub(r"[<>=,/]", "-", ending), setting, read_names(keys, "inputs", inputs),
                     read_names(keys, "codecs", codecs), keys["compare"].boolean() if "compare" in keys else True)


def read_metrics(place, option_names):
    if isinstance(place.value, bool):
        return () if place.value else None
    return read_options(place, option_names("voxdiff"), OURS, "voxdiff")


def read_options(place, known, ours, tool):
    grid = read_grid(place, known, ours, tool)
    if len(grid) > 1:
        place.fail("expected one value of each option")
    return grid[0]


def read_grid(place, known, ours, tool):
    """All combinations of the values that an object gives options: a list of tuples of pairs."""
    axes = []
    for key, values in place.members([]).items():
        if key not in known:
            place.fail(f'{tool} has no option "{key}": did you mean "{nearest(key, sorted(known - ours))}"?')
        if key in ours:
            values.fail(f"is given by vox-sweep: expected an option of what {tool} does")
        items = values.items() if isinstance(values.value, list) else [values]
        if not items or len(items) > MOST_VALUES:
            values.fail(f"expected 1 to {MOST_VALUES} values")
        axes.append([(key, option_value(item)) for item in items])
    if math.prod(len(axis) for axis in axes) > MOST_SETTINGS:
        place.fail(f"more than {MOST_SETTINGS} combinations: expected fewer values", LIMIT)
    # false and null: the option is not given.
    return [tuple(pair for pair in combination if pair[1] is not None) for combination in itertools.product(*axes)]


def option_value(place):
    """A text as on a command line; True for a flag; None where it is not given."""
    value = place.value
    if value is None or value is False:
        return None
    if value is True or (isinstance(value, str) and value.isprintable()):
        return value
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float) and math.isfinite(value):
        return repr(value).removesuffix(".0")
    return place.fail("expected a text, a number, true, false or null, or a list of these")


def read_plots(place, inputs, codecs):
    names = []
    for item in place.items():
        keys = item.members(["name", "title", "x", "y", "log", "label", "line", "fit", "baseline", "inputs", "codecs"],
                            ["name", "x", "y"])
        name = keys["name"].text()
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}", name) or name in names:
            keys["name"].fail("expected a name of letters, digits, dots and dashes that no other has, for files")
        names.append(name)
        log = keys["log"].value if "log" in keys else ""
        if log not in ("", "x", "y", "xy"):
            keys["log"].fail("expected x, y or xy")
        line = keys["line"].value if "line" in keys else "front"
        if line not in ("front", "all", "none"):
            keys["line"].fail("expected front, all or none")
        if "fit" in keys and keys["fit"].value != "power":
            keys["fit"].fail("expected power")
        yield Plot(name, keys["title"].text() if "title" in keys else name, keys["x"].text(), keys["y"].text(),
                   "x" in log, "y" in log, tuple(label.text() for label in keys["label"].items()) if "label" in keys else (),
                   line, "power" if "fit" in keys else "", keys["baseline"].text() if "baseline" in keys else "",
                   read_names(keys, "inputs", inputs), read_names(keys, "codecs", codecs))
