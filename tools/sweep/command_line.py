"""The options of vox-sweep: those that every program of ours has, and its own; messages as the others word them."""
import dataclasses
import json
import os
import re
import textwrap

from sweep.failure import Failure, USAGE, nearest
from sweep.build import TOOL

PURPOSE = "Runs a grid of encodes, decodes, renders and comparisons, and shows which setting to take."
EXAMPLES = """  vox-sweep sweep.json -o sweep
  vox-sweep sweep.yaml -o sweep --best "psnr>=45" --json
  vox-sweep sweep.json -o sweep --dry-run
  vox-sweep sweep.json -o sweep --snakemake
"""
EXIT_CODES = {0: "done", 1: "the check answered no: a setting failed, or none is as --best asks", 2: "usage",
              3: "input unreadable", 4: "output cannot be written", 5: "a limit was reached", 70: "a bug of ours"}
SPEC_HELP = "What to run: a .json or .yaml file, as tools/sweep/README.md describes it, or - for JSON on standard input"


@dataclasses.dataclass
class Option:
    short: str
    long: str
    metavar: str  # "" for a flag
    help: str
    read: object = None  # of a value: text to value, or a Failure that does not name the option
    several: bool = False
    kind: str = ""  # what the value names: "folder"

    def names(self):
        return ([f"-{self.short}"] if self.short else []) + [f"--{self.long}"]

    def required(self):
        return self.long == "output"

    def excludes(self):
        """What --help says of it."""
        return ["--" + (b if a == self.long else a) for a, b in EXCLUDES[:1] if self.long in (a, b)]


@dataclasses.dataclass
class Options:
    spec: str = ""
    output: str = ""
    data: str = ""
    dry_run: bool = False
    snakemake: bool = False
    collect: bool = False
    case: str = ""
    best: list = dataclasses.field(default_factory=list)
    quiet: bool = False
    verbose: bool = False
    threads: int = 0
    force: bool = False
    json: bool = False
    progress: str = "auto"
    max_memory: int = 0


def whole_number(least, greatest):
    def read(text):
        if not re.fullmatch(r"-?[0-9]+", text, re.ASCII) or not least <= int(text) <= greatest:
            raise Failure(USAGE, f'"{text}": expected a whole number from {least} to {greatest}')
        return int(text)

    return read


def size(text):
    """Bytes: 4096, 64K, 512M, 3G; powers of 1024."""
    found = re.fullmatch(r"([0-9]+)([KkMmGg]?)", text, re.ASCII)
    value = int(found[1]) << {"": 0, "k": 10, "m": 20, "g": 30}[found[2].lower()] if found else 0
    if not 0 < value < 1 << 64:
        raise Failure(USAGE, f'"{text}": expected a number of bytes such as 4096, 64K, 512M or 3G')
    return value


def one_of(*words):
    def read(text):
        if text not in words:
            raise Failure(USAGE, f'"{text}": expected {", ".join(words[:-1])} or {words[-1]}')
        return text

    read.words = words
    return read


OPTIONS = [
    Option("h", "help", "", "Show this help"),
    Option("V", "version", "", "Show the version"),
    Option("o", "output", "DIR", "Folder of the results; what is there already is not run again", str,
           kind="folder"),
    Option("", "data", "DIR", 'Folder of the inputs that the spec marks with "data"; without it they are left out', str, kind="folder"),
    Option("", "dry-run", "", "Print what would be run, and how much of it is done"),
    Option("", "best", "CONDITIONS", "Print the smallest setting of each input that fulfils all of them, such as "
           '"psnr>=45,decode_seconds<2"; exit 1 if there is none', str, several=True),
    Option("", "snakemake", "", "Write DIR/Snakefile, which runs the same settings by Snakemake, on Slurm too"),
    Option("", "case", "ID", "Run one setting only, and write no tables; what the Snakefile calls", str),
    Option("", "collect", "", "Run nothing: write the tables and the page of what is done"),
    Option("q", "quiet", "", "Print nothing but errors"),
    Option("v", "verbose", "", "Print more detail on standard error"),
    Option("j", "threads", "N", "Threads of all that runs at a time; 0: all that this process may use (also VOX_THREADS)",
           whole_number(0, 4096)),
    Option("f", "force", "", "Run everything again; overwrite an existing Snakefile"),
    Option("", "json", "", "Print the result as one JSON object"),
    Option("", "progress", "auto|plain|never", "Progress on standard error; plain: key=value lines",
           one_of("auto", "plain", "never")),
    Option("", "max-memory", "SIZE", "Memory for voxels of all that runs at a time, such as 512M or 3G", size),
]
EXCLUDES = [("quiet", "verbose"), ("dry-run", "snakemake"), ("dry-run", "collect"), ("dry-run", "best"),
            ("snakemake", "collect"), ("snakemake", "best"), ("case", "dry-run"), ("case", "snakemake"),
            ("case", "collect"), ("case", "best"), ("collect", "force")]


def help_text():
    lines = [PURPOSE, f"Usage: {TOOL} [OPTIONS] SPEC", "", "Positionals:",
             textwrap.fill(f"{'  SPEC REQUIRED':<33} {SPEC_HELP}", 110, subsequent_indent=" " * 34, replace_whitespace=False), "", "Options:"]
    for option in OPTIONS:
        names = "  " + ",".join(option.names())
        if option.metavar:
            names += f" {option.metavar}" + (" ..." if option.several else "")
        if option.required():
            names += " REQUIRED"
        names += "".join(f" Excludes: {name}" for name in option.excludes())
        lines.append(f"{names:<33} {option.help}")
    codes = "; ".join(f"{code} {meaning}" for code, meaning in EXIT_CODES.items())
    return "\n".join(lines) + f"\n\nExamples:\n{EXAMPLES}\n" + textwrap.fill(f"Exit codes: {codes}.", 98) + "\n"


def description():
    """What --describe prints, as that of the other programs: what manual pages and completions are made from."""
    options = [{"names": option.names(), "value": option.metavar + (" ..." if option.several else ""), "help": option.help,
                "required": option.required(), "kind": option.kind, "words": list(getattr(option.read, "words", ())),
                "excludes": option.excludes()} for option in OPTIONS]
    return json.dumps({"schema": 1, "tool": TOOL, "purpose": PURPOSE, "arguments": [{"name": "SPEC", "help": SPEC_HELP}],
                       "options": options, "examples": [line.strip() for line in EXAMPLES.splitlines()],
                       "exit_codes": [{"code": code, "meaning": meaning} for code, meaning in EXIT_CODES.items()]}, indent=2) + "\n"


def looks_like_option(word):
    return re.match(r"--?[A-Za-z]", word) is not None


class Reader:
    """Takes words from the command line."""

    def __init__(self, words):
        self.words, self.at = words, 0
        self.options, self.given, self.positionals = Options(), set(), []
        self.errors = []  # the first is what is said, unless there is an unknown option
        self.unknown = None
        self.shown = None  # "help" or "version", whichever comes first

    def option(self, name, is_short):
        for option in OPTIONS:
            if name and name == (option.short if is_short else option.long):
                return option
        return None

    def value(self, option, attached):
        if attached is not None:
            return attached
        if self.at < len(self.words) and not looks_like_option(self.words[self.at]):
            self.at += 1
            return self.words[self.at - 1]
        self.errors.append(f"--{option.long}: 1 required {option.metavar} missing: see --help")
        return None

    def take(self, option, attached):
        self.given.add(option.long)
        if option.long in ("help", "version"):
            self.shown = self.shown or option.long
            return
        attribute = option.long.replace("-", "_")
        if not option.metavar:
            if attached is not None:
                self.errors.append(f"--{option.long}: expected no value: see --help")
            setattr(self.options, attribute, True)
            return
        text = self.value(option, attached)
        if text is None:
            return
        try:
            value = option.read(text)
        except Failure as failure:
            self.errors.append(f"--{option.long}: {failure.what}")
            return
        if option.several:
            getattr(self.options, attribute).append(value)
        else:
            setattr(self.options, attribute, value)

    def read(self):
        only_positionals = False
        while self.at < len(self.words):
            word = self.words[self.at]
            self.at += 1
            if only_positionals or word == "-" or not word.startswith("-"):
                self.positionals.append(word)
            elif word == "--":
                only_positionals = True
            elif word.startswith("--"):
                name, equals, attached = word[2:].partition("=")
                self.known(self.option(name, False), f"--{name}", attached if equals else None)
            else:
                self.short_options(word)

    def short_options(self, word):
        rest = word[1:]
        while rest:
            option, attached = self.option(rest[0], True), rest[1:]
            if option is None or option.metavar:
                self.known(option, word.partition("=")[0], attached.removeprefix("=") if attached else None)
                return
            self.take(option, None)
            rest = attached

    def known(self, option, name, attached):
        if option is None:
            self.unknown = self.unknown or name
        else:
            self.take(option, attached)


def option_names():
    return [name for option in OPTIONS for name in reversed(option.names())]


def parse(words, version):
    """(Options, None), or (None, a text to print)."""
    if words == ["--describe"]:
        return None, description()
    reader = Reader(words)
    reader.read()
    if reader.shown == "help":
        return None, help_text()
    if reader.shown == "version":
        return None, f"{TOOL} {version}\n"
    if reader.unknown is not None:
        raise Failure(USAGE, f"unknown option {reader.unknown}: did you mean {nearest(reader.unknown, option_names())}?")
    if reader.errors:
        raise Failure(USAGE, reader.errors[0])
    if not reader.positionals:
        raise Failure(USAGE, "SPEC is required: see --help")
    if len(reader.positionals) > 1:
        raise Failure(USAGE, f'unexpected argument "{reader.positionals[1]}": see --help')
    options = reader.options
    options.spec = reader.positionals[0]
    if not options.output:
        raise Failure(USAGE, "--output is required: see --help")
    for a, b in EXCLUDES:
        if a in reader.given and b in reader.given:
            raise Failure(USAGE, f"--{a} excludes --{b}: see --help")
    if "threads" not in reader.given and "VOX_THREADS" in os.environ:
        try:
            options.threads = whole_number(0, 4096)(os.environ["VOX_THREADS"])
        except Failure as failure:
            raise Failure(USAGE, f"the environment variable VOX_THREADS: {failure.what}") from None
    return options, None
