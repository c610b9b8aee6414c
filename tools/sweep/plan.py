"""What a Spec comes to: settings, and for each the programs to run, in order.

A step is one run of one program. Its key is a hash of the program's version, its command, and what its inputs are, so a
step that was done before is found again by its name, and one that has become another is not.
"""
import dataclasses
import glob
import hashlib
import json
import os
import re
import shlex

from sweep.spec import ENDINGS, is_surface

# What dagcolor-pack makes of a mesh, however it stores colours.
OF_GEOMETRY = ("resolution", "surface")


@dataclasses.dataclass
class Step:
    kind: str        # encode, decode, compare, render, or reference: what renders and comparisons are held against
    tool: str
    words: list      # of the command, but for names of files in the work folder, which begin with WORK
    needs: list      # steps whose output is read
    output: str      # file of the work folder, or "", or a pattern of pictures
    threads: int     # 0: as many as there are
    repeat: int = 1  # times to run it; the fastest counts
    name: str = ""   # of the record, without ending
    label: str = ""  # for people

    def command(self, work, options=()):
        return [self.tool] + [word.replace(WORK, work + "/") for word in self.words] + list(options)

    def shown(self):
        return shlex.join([self.tool] + [word.replace(WORK, "") for word in self.words])


WORK = "\0"  # no name of a file has it


@dataclasses.dataclass
class Case:
    """One setting of one codec, for one input."""
    name: str
    input: object
    codec: object
    options: tuple
    encode: Step
    decode: Step | None
    compare: Step | None
    renders: dict    # by the name of the Render
    references: dict  # pictures of the uncompressed volume, likewise

    def steps(self):
        """In an order in which they can be run; those that other settings need as well among them."""
        steps = {}

        def add(step):
            for need in step.needs:
                add(need)
            steps[step.name] = step

        for step in [self.encode, self.decode, self.compare, *self.renders.values(), *self.references.values()]:
            if step:
                add(step)
        return list(steps.values())

    def setting(self):
        return setting_text(self.options)


def setting_text(options):
    return " ".join(f"--{key}" if value is True else f"--{key} {shlex.quote(value)}" for key, value in options)


def words_of(options):
    words = []
    for key, value in options:
        if value is True:
            words.append(f"--{key}")
        elif value.startswith("-"):
            words.append(f"--{key}={value}")
        else:
            words += [f"--{key}", value]
    return words


def slug(text):
    return re.sub(r"[^A-Za-z0-9.]+", "-", text).strip("-.")[:60] or "unnamed"


def identity(name, folder):
    """What a file is known by: size and time of what has this name, of all files of a folder or a pattern; built-ins are known by name."""
    path = os.path.join(folder, name)
    paths = [path]
    if os.path.isdir(path):
        paths = sorted(entry.path for entry in os.scandir(path) if entry.is_file())
    elif re.search(r"%[0-9]*d", name):
        paths = sorted(glob.glob(re.sub(r"%[0-9]*d", "*", glob.escape(path))))
    known = []
    for found in paths:
        try:
            status = os.stat(found)
            known.append([os.path.relpath(found, folder), status.st_size, status.st_mtime_ns])
        except OSError:
            pass
    return known


class Planner:
    def __init__(self, spec, versions):
        self.spec, self.versions = spec, versions
        self.made = {}  # steps by name: what several settings share is there once
        self.identities = {}

    def step(self, kind, tool, words, needs=(), output="", title=""):
        """`output`: ending of the file that it writes. Threads among the options are part of what is measured."""
        threads = 0
        for at, word in enumerate(words[:-1]):
            if word in ("--threads", "-j") and words[at + 1].isdigit():
                threads = int(words[at + 1])
        for word in words:  # files that options name, too
            if word and word not in self.identities and WORK not in word:
                self.identities[word] = identity(word, self.spec.folder)
        repeat = self.spec.repeat if kind in ("encode", "decode", "render") else 1
        content = [self.versions[tool], repeat, kind, tool, words, output, [need.name for need in needs],
                   [self.identities[word] for word in words if self.identities.get(word)]]
        digest = hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]
        name = f"{slug(title)}-{kind}-{digest}"
        if name not in self.made:
            full = [word.replace(WORK + WORK, WORK + name + output) for word in words]
            self.made[name] = Step(kind, tool, full, list(needs), name + output if output else "",
                                   threads or self.spec.threads, repeat, name, f"{kind} {title}")
        return self.made[name]

    def case(self, entry, codec, options):
        spec, title = self.spec, f"{entry.name} {codec.name} " + setting_text(options)
        given, own = words_of(entry.options), WORK + WORK  # own: what the step itself writes
        encode = self.step("encode", codec.tool, [entry.file, "-o", own, "--json", *given, *words_of(options)],
                           output=ENDINGS[codec.tool], title=title)
        packed = WORK + encode.output
        decode = None
        if spec.decode:
            ending = ".ply" if codec.tool == "dagcolor-pack" else ".nrrd"
            decode = self.step("decode", "vox-decode", [packed, "-o", own, "--json"], [encode], ending, title)
        reference, needs = entry.reference or entry.file, []
        if not entry.reference and is_surface(entry.file):
            # A mesh has no voxels: colours as they are, of the same voxels.
            geometry = tuple(pair for pair in options if pair[0] in OF_GEOMETRY)
            raw = self.step("reference", "dagcolor-pack",
                            [entry.file, "-o", own, "--json", *given, *words_of(geometry), "--codec", "raw"],
                            output=".dagc", title=entry.name)
            reference, needs = WORK + raw.output, [raw]
        compare = None
        if spec.metrics is not None:
            compare = self.step("compare", "voxdiff", [reference, packed, "--json", *given, *words_of(spec.metrics)],
                                [encode, *needs], title=title)
        case = Case(slug(title), entry, codec, options, encode, decode, compare, {}, {})
        for render in spec.renders:
            if entry.name in render.inputs and codec.name in render.codecs:
                self.add_render(case, render, packed, reference, needs, given, title)
        names = json.dumps([step.name for step in case.steps()])
        case.name = f"{slug(title)}-{hashlib.sha256(names.encode()).hexdigest()[:8]}"
        return case

    def add_render(self, case, render, packed, reference, needs, given, title):
        named, own = dict(render.options), WORK + WORK
        words = ["--json", *given, *words_of(render.options)]
        ending, target = "", []
        if "no-images" not in named:
            ending = "-%04d.png" if "path" in named else ".png"
            target = ["-o", own]
        if target and render.compare:
            plain = tuple(pair for pair in render.options if pair[0] != "reference-traversal")
            case.references[render.name] = self.step(
                "reference", "vox-render", [reference, *target, "--json", *given, *words_of(plain)], needs, ending,
                f"{case.input.name} {render.name}")
        against, more = (["--reference", reference], needs) if render.compare else ([], [])
        case.renders[render.name] = self.step("render", "vox-render", [packed, *target, *against, *words],
                                              [case.encode, *more], ending, f"{title} {render.name}")


def cases_of(spec, versions):
    """All settings, in the order of the spec."""
    planner = Planner(spec, versions)
    return [planner.case(entry, codec, options) for entry in spec.inputs for codec in spec.codecs
            if entry.name in codec.inputs for options in codec.settings]
