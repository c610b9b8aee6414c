"""What vox-sweep does, from its command line to its exit code."""
import contextlib
import fcntl
import json
import os
import re
import subprocess
import sys
import time
import traceback

from sweep import command_line, signals
from sweep.build import TOOL
from sweep.failure import BUG, INPUT, LIMIT, NO, OUTPUT, USAGE, Failure, Interrupted, printable

MARK = "sweep.json"  # the file by which a folder of results is known


def main(words, build):
    signals.handle()
    sys.stdout.reconfigure(errors="backslashreplace")  # of names that are no UTF-8
    try:
        return work(words, build)
    except Failure as failure:
        return report(failure.line(), failure.code)
    except Interrupted as interrupted:
        return report("interrupted: what was done is kept: run it again to go on", 128 + interrupted.number)
    except MemoryError:
        return report("out of memory: use fewer settings", LIMIT)
    except OSError as error:
        if error.filename is None:  # of standard output; Python would complain at its end, too
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return report(f"{error.filename or 'standard output'}: {error.strerror or error}", OUTPUT)
    except Exception as error:  # a bug of ours: where, for its report
        where = traceback.extract_tb(error.__traceback__)[-1]
        return report(f"a bug of ours: {type(error).__name__}: {error} ({os.path.basename(where.filename)}:{where.lineno})", BUG)


def report(line, code):
    sys.stderr.write(f"{TOOL}: {printable(line)}\n")
    return code


def print_out(text):
    sys.stdout.write(text)
    sys.stdout.flush()


def work(words, build):
    options, shown = command_line.parse(words, build.text())
    if options is None:
        print_out(shown)
        return 0
    from sweep import best, machine, plan, spec as spec_file
    conditions = best.parse(options.best)
    if options.snakemake and options.spec == "-":
        raise Failure(USAGE, "--snakemake: jobs read SPEC again: expected a file")
    check_output(options.output)
    if options.data and not os.path.isdir(options.data):
        raise Failure(INPUT, "is no folder: expected that of the data", options.data)
    spec = spec_file.read(options.spec, OptionNames(build), options.data)
    if spec.left_out and not options.quiet:
        sys.stderr.write(f"{TOOL}: left out: {printable(', '.join(spec.left_out))}: --data names the folder that they are in\n")
    threads = options.threads or machine.available_threads()
    memory = options.max_memory or machine.usable_memory() // 4 * 3
    versions = versions_of(spec, build)
    cases = plan.cases_of(spec, versions)
    if options.dry_run:
        return dry_run(options, cases)
    if options.snakemake:
        return write_workflow(options, spec, cases, build, threads, memory)
    if options.case and options.case not in [case.name for case in cases]:
        raise Failure(USAGE, f'--case: there is no "{options.case}": expected one that --snakemake wrote for this spec')
    sweep = Sweep(options, spec, cases, build, threads, memory)
    return sweep.one_case() if options.case else sweep.run(conditions)


class OptionNames:
    """The long options of our other programs, as their --help lists them."""

    def __init__(self, build):
        self.build, self.known = build, {}

    def __call__(self, tool):
        if tool not in self.known:
            shown = ask(self.build.program(tool), tool, "--help")
            self.known[tool] = set(re.findall(r"^ +(?:-\w,)?--([a-z0-9-]+)", shown, re.MULTILINE))
        return self.known[tool]


def ask(program, tool, option):
    try:
        done = subprocess.run([program, option], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, timeout=60)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise Failure(INPUT, f"{program}: does not run: {error}") from None
    if done.returncode != 0:
        raise Failure(INPUT, f"does not run: {tool} {option} ended with exit code {done.returncode}", program)
    return done.stdout


def versions_of(spec, build):
    tools = {codec.tool for codec in spec.codecs} | {"vox-decode", "voxdiff", "vox-render", "dagcolor-pack"}
    return {tool: ask(build.program(tool), tool, "--version").strip() for tool in sorted(tools)}


def check_output(folder):
    """A folder of results, or one to be: new or empty. Nothing else is written into."""
    if not os.path.lexists(folder):
        parent = os.path.dirname(os.path.abspath(folder))
        if not os.path.isdir(parent):
            raise Failure(OUTPUT, f"cannot be written: the folder {parent} does not exist", folder)
        if not os.access(parent, os.W_OK):
            raise Failure(OUTPUT, f"cannot be written: no permission in {parent}", folder)
        return
    if not os.path.isdir(folder):
        raise Failure(OUTPUT, "is no folder: expected one, or a name that is free", folder)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise Failure(OUTPUT, "cannot be written: no permission", folder)
    if os.listdir(folder) and not os.path.exists(os.path.join(folder, MARK)):
        raise Failure(OUTPUT, f"exists, and is no folder of {TOOL}: expected a new or an empty one", folder)


def prepare(folder):
    """Makes the folder of results; the folder of records in it is returned."""
    from sweep.runner import write_whole
    records = os.path.join(folder, "work")
    try:
        os.makedirs(records, exist_ok=True)
    except OSError as error:
        raise Failure(OUTPUT, f"cannot be written: {error.strerror}", folder) from None
    mark = os.path.join(folder, MARK)
    if not os.path.exists(mark):
        write_whole(mark, json.dumps({"schema": 1, "tool": TOOL}) + "\n")
    return records


def dry_run(options, cases):
    """Prints every command, in order, once."""
    from sweep.runner import Records
    records = Records(os.path.join(options.output, "work"))
    steps = list({step.name: step for case in cases for step in case.steps()}.values())
    listed = [{"step": step.kind, "command": step.shown(), "finished": records.final(step)} for step in steps]
    finished = sum(entry["finished"] for entry in listed)
    if options.json:
        print_out(json.dumps({"schema": 1, "tool": TOOL, "settings": len(cases), "steps": len(steps), "finished": finished,
                              "plan": listed}, indent=2) + "\n")
        return 0
    print_out("".join(f"{'done' if entry['finished'] else 'run '} {entry['command']}\n" for entry in listed))
    if not options.quiet:
        sys.stderr.write(f"{TOOL}: {len(cases)} settings, {len(steps)} steps, {finished} of them done\n")
    return 0


def write_workflow(options, spec, cases, build, threads, memory):
    from sweep import workflow
    from sweep.runner import write_whole
    path = os.path.join(options.output, "Snakefile")
    if os.path.exists(path) and not options.force:
        raise Failure(OUTPUT, "exists: use --force to overwrite", path)
    prepare(options.output)
    each = min(spec.threads or threads, threads)
    write_whole(path, workflow.text(cases, options, os.path.join(build.folder, TOOL), each,
                                    memory // max(threads // each, 1)))
    if options.json:
        print_out(json.dumps({"schema": 1, "tool": TOOL, "settings": len(cases), "output": path}, indent=2) + "\n")
    elif not options.quiet:
        sys.stderr.write(f"{TOOL}: {path}: {len(cases)} settings: snakemake --snakefile {path} --cores {threads}\n")
    return 0


class Sweep:
    def __init__(self, options, spec, cases, build, threads, memory):
        from sweep.progress import Progress
        from sweep.runner import Records
        self.options, self.spec, self.cases, self.build = options, spec, cases, build
        self.threads, self.memory, self.start = threads, memory, time.monotonic()
        self.records = Records(prepare(options.output))
        self.progress = Progress(options.progress, options.quiet)
        self.failed_before = set()

    def runner(self):
        from sweep.runner import Runner
        return Runner(self.spec, self.build, self.records, self.cases, self.threads, self.memory, self.ended)

    def ended(self, step, record, done, total):
        """A step has ended."""
        if self.options.verbose:
            self.progress.close()
            how = record.get("error") or f"{record['seconds']:.2f} s"
            sys.stderr.write(f"{TOOL}: {printable(step.label)}: {printable(how)}\n")
        self.progress.update(done, total, step.label)

    @contextlib.contextmanager
    def locked(self, kind):
        """Whole sweeps want the folder for themselves, single settings share it."""
        with open(os.path.join(self.options.output, ".lock"), "w", encoding="ascii") as file:
            try:
                fcntl.flock(file, kind | fcntl.LOCK_NB)
            except BlockingIOError:
                raise Failure(OUTPUT, f"is in use: another {TOOL} is running", self.options.output) from None
            except OSError:
                pass  # a file system without locks
            yield

    def run_cases(self, cases):
        runner = self.runner()
        try:
            if self.options.force:
                for step in {step.name: step for case in cases for step in case.steps()}.values():
                    self.records.forget(step)
            runner.run(cases)
        finally:
            self.progress.close()
        return runner

    def one_case(self):
        chosen = [case for case in self.cases if case.name == self.options.case]
        with self.locked(fcntl.LOCK_SH):
            self.run_cases(chosen)
        errors = [self.records.find(step)["error"] for step in chosen[0].steps() if not self.records.done(step)]
        if self.options.json:
            print_out(json.dumps({"schema": 1, "tool": TOOL, "case": chosen[0].name,
                                  "status": "failed" if errors else "done", "error": errors[0] if errors else None}, indent=2) + "\n")
        return report(f"{chosen[0].name}: {errors[0]}", NO) if errors else 0

    def run(self, conditions):
        with self.locked(fcntl.LOCK_EX):
            self.remove_leftovers()
            runner = None if self.options.collect else self.run_cases(self.cases)
            return self.finish(conditions, runner)

    def remove_leftovers(self):
        """Hidden files of programs that were killed."""
        for name in os.listdir(self.records.work):
            if name.startswith("."):
                os.unlink(os.path.join(self.records.work, name))

    def finish(self, conditions, runner):
        from sweep import best, machine, table
        what = machine.description()
        rows = table.rows_of(self.cases, self.records, self.build, what)
        flats = [table.flat(row) for row in rows]
        self.write_all(rows, flats, what)
        statuses = [row["status"] for row in rows]
        answers, code = [], NO if "failed" in statuses else 0
        if conditions:
            columns = table.columns_of(flats)
            conditions = best.resolve(conditions, columns, "missing" not in statuses)
            answers = best.best(rows, flats, conditions)
            code = NO if code or not all(answer["found"] for answer in answers) else 0
        self.say(rows, statuses, answers, conditions, runner)
        return code

    def write_all(self, rows, flats, what):
        from sweep import page, plots, table
        from sweep.runner import write_whole
        folder = self.options.output
        write_whole(os.path.join(folder, "results.jsonl"), table.jsonl_text(rows))
        write_whole(os.path.join(folder, "results.csv"), table.csv_text(flats))
        if not page.chart_script():
            self.note("index.html has no charts: Chart.js is not there: expected the package libjs-chart.js")
        write_whole(os.path.join(folder, "index.html"),
                    page.page_text(self.spec, self.cases, flats, self.build, what, self.records.work))
        if plots.fresh(self.spec, flats, os.path.join(folder, "plots")):
            pass
        elif plots.available():
            for name in dict.fromkeys(plots.write(self.spec, flats, os.path.join(folder, "plots"))):
                self.note(f'no plot of "{name}": no result has it')
        else:
            self.note("no plots as files: expected the package python3-matplotlib")

    def note(self, line):
        if not self.options.quiet:
            sys.stderr.write(f"{TOOL}: {printable(line)}\n")

    def say(self, rows, statuses, answers, conditions, runner):
        from sweep import best
        folder, failed, missing = self.options.output, statuses.count("failed"), statuses.count("missing")
        if self.options.json:
            result = {"schema": 1, "tool": TOOL, "version": self.build.text(), "spec": self.options.spec, "output": folder,
                      "settings": len(rows), "failed": failed, "missing": missing, "steps": runner.total if runner else 0,
                      "steps_run": runner.ran if runner else 0, "seconds": time.monotonic() - self.start,
                      "threads": self.threads}
            if answers:
                result["best"] = answers
            print_out(json.dumps(result, indent=2, ensure_ascii=False) + "\n")
        elif answers:
            print_out(best.text(answers, conditions))
        if not self.options.quiet and not self.options.json:
            ran = f", {runner.ran} of {runner.total} steps run now" if runner else ""
            late = f", {missing} not run yet" if missing else ""
            sys.stderr.write(f"{os.path.join(folder, 'index.html')}: {len(rows)} settings{late}{ran}, "
                             f"in {time.monotonic() - self.start:.2f} s\n")
        if failed:
            first = next(row for row in rows if row["status"] == "failed")
            name = f"{first['input']} {first['codec']} {first['setting']}".rstrip()
            report(f"{folder}: {failed} of {len(rows)} settings failed, first {name}: {first['error']}", NO)
