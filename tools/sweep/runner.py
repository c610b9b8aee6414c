"""Runs steps as processes, side by side as far as threads and memory allow, and records each in a file of its own.

A record appears whole or not at all, after what the step wrote. So whatever kills the sweep, the next one goes on where it
stopped; a program that was killed in the middle has left nothing but a hidden file.
"""
import ctypes
import json
import os
import select
import signal
import subprocess
import time

from sweep import signals
from sweep.failure import BUG, INPUT, NO, printable

FINAL = (NO, 2, INPUT)  # exit codes that come again however often a step is run
MOST_OUTPUT = 64 << 20  # bytes of a result that are read


def write_whole(path, data):
    """A file appears whole or not at all; data is text or bytes."""
    temporary = os.path.join(os.path.dirname(path), f".{os.path.basename(path)[:200]}.voxkit-{os.getpid()}")
    try:
        with open(temporary, "wb") as file:
            file.write(data.encode() if isinstance(data, str) else data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        if os.path.exists(temporary):
            os.unlink(temporary)
        raise


def pictures(step, work):
    """The first picture of a step."""
    return os.path.join(work, step.output.replace("%04d", "0000"))


def is_record(value):
    if not isinstance(value, dict) or not isinstance(value.get("exit_code"), int) or not isinstance(value.get("seconds"), (int, float)):
        return False
    return isinstance(value.get("result"), dict) if value.get("status") == "done" else isinstance(value.get("error"), str)


class Records:
    """What is known of steps: records of this folder."""

    def __init__(self, work):
        self.work, self.known = os.path.abspath(work), {}

    def path(self, step):
        return os.path.join(self.work, step.name + ".json")

    def find(self, step):
        """The record, or None if the step has not been run, or what is left of it is no record."""
        if step.name not in self.known:
            try:
                with open(self.path(step), encoding="utf-8") as file:
                    record = json.load(file)
                self.known[step.name] = record if is_record(record) else None
            except (OSError, ValueError):
                return None
        return self.known[step.name]

    def done(self, step):
        record = self.find(step)
        return record is not None and record["status"] == "done"

    def final(self, step):
        """Whether it need not be run again: it was done, or it failed and would fail again."""
        record = self.find(step)
        return record is not None and (record["status"] == "done" or record["exit_code"] in FINAL)

    def store(self, step, record):
        self.known[step.name] = record
        write_whole(self.path(step), json.dumps(record, indent=1) + "\n")

    def forget(self, step):
        self.known.pop(step.name, None)
        if os.path.exists(self.path(step)):
            os.unlink(self.path(step))


LIBC = ctypes.CDLL(None)
PR_SET_PDEATHSIG = 1


def die_with_parent():
    """Whatever kills us kills what we run, too."""
    LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def faster(before, record):
    """The one of two records of a step whose program took less time, by its own clock; the first may be None."""
    def seconds(one):
        found = [one["result"].get(key) for key in ("encode_seconds", "decode_seconds", "ms_avg")]
        return next((value for value in found if isinstance(value, (int, float))), one["seconds"])

    return record if before is None or seconds(record) < seconds(before) else before


class Process:
    """One step, running."""

    def __init__(self, step, command, threads, work, folder):
        self.step, self.command, self.threads, self.start = step, command, threads, time.monotonic()
        self.run, self.best = 1, None  # which of the step's runs this is, and the fastest before it
        base = os.path.join(work, f".{step.name}.{os.getpid()}")
        self.out, self.err = base + ".out", base + ".err"
        self.late = False
        with open(self.out, "wb") as out, open(self.err, "wb") as err:
            # Its own group: a terminal's Ctrl-C reaches us alone, and we stop it.
            self.child = subprocess.Popen(command, cwd=folder, stdin=subprocess.DEVNULL, stdout=out, stderr=err,
                                          start_new_session=True, preexec_fn=die_with_parent)

    def ended(self):
        """The record, or None while it runs."""
        pid, status, usage = os.wait4(self.child.pid, os.WNOHANG)
        if pid == 0:
            return None
        self.child.returncode = os.waitstatus_to_exitcode(status)
        record = {"schema": 1, "step": self.step.kind, "command": self.step.shown(), "status": "done",
                  "exit_code": self.child.returncode, "seconds": time.monotonic() - self.start,
                  "cpu_seconds": usage.ru_utime + usage.ru_stime, "peak_rss_bytes": usage.ru_maxrss * 1024}
        self.read_result(record)
        self.remove()
        return record

    def read_result(self, record):
        with open(self.out, "rb") as file:
            out = file.read(MOST_OUTPUT)
        with open(self.err, "rb") as file:
            lines = file.read(1 << 16).decode(errors="replace").splitlines()
        code = record["exit_code"]
        if code == 0:
            try:
                record["result"] = json.loads(out)
                return
            except ValueError:
                code = record["exit_code"] = BUG
                lines = [f"{self.step.tool}: printed no JSON"]
        record["status"] = "failed"
        if self.late:
            lines = [f"{self.step.tool}: was stopped: it took longer than the timeout"]
        elif code < 0:
            lines = lines or [f"{self.step.tool}: was killed by {signal.Signals(-code).name}"]
        line = lines[-1] if lines else f"{self.step.tool}: ended with exit code {code}"
        record["error"] = printable(line).replace(os.path.dirname(self.out) + "/", "")

    def remove(self):
        for path in (self.out, self.err):
            if os.path.exists(path):
                os.unlink(path)

    def stop(self, number=signal.SIGTERM):
        try:
            os.killpg(self.child.pid, number)
        except ProcessLookupError:
            pass


class Runner:
    """`threads` and `memory` are those of all that runs at a time."""

    def __init__(self, spec, build, records, cases, threads, memory, on_end):
        """`cases`: all of the sweep, for what is shared; `on_end` is told of every step that has ended."""
        self.spec, self.build, self.records, self.on_end = spec, build, records, on_end
        self.threads = threads
        self.users = {}
        for step in {step.name: step for case in cases for step in case.steps()}.values():
            for need in step.needs:
                self.users.setdefault(need.name, []).append(step)
        each = min(spec.threads or threads, threads)
        self.each, self.memory = each, memory // max(threads // each, 1)
        self.running, self.waiting = [], []
        self.ran = self.finished = self.total = 0

    def run(self, cases):
        """Runs what is not done. Raises Interrupted when a signal comes; nothing runs any more then."""
        steps = {step.name: step for case in cases for step in case.steps()}
        self.waiting = self.needed(steps)
        self.total = len(steps)
        self.finished = self.total - len(self.waiting)
        with signals.deferred():
            self.loop()
        signals.check()
        for step in steps.values():
            self.remove_served(step)

    def loop(self):
        """Until nothing is left, or a signal has come."""
        wake, woken = os.pipe()
        for end in (wake, woken):
            os.set_blocking(end, False)
        signal.set_wakeup_fd(woken, warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        try:
            while self.waiting or self.running:
                signals.check()
                self.start_some()
                select.select([wake], [], [], 0.2 if self.spec.timeout else 1)
                try:
                    os.read(wake, 4096)
                except BlockingIOError:
                    pass
                self.collect()
        finally:
            signal.set_wakeup_fd(-1)
            self.stop_all()
            os.close(wake)
            os.close(woken)

    def needed(self, steps):
        """Those to be run: not final, or their output is gone and somebody needs it."""
        needed = {}

        def want(step):
            if step.name in needed:
                return
            if self.records.done(step):
                self.records.forget(step)  # what it wrote is gone
            for need in step.needs:
                if not self.records.final(need) or (self.records.done(need) and not self.there(need)):
                    want(need)
            needed[step.name] = step

        for step in steps.values():
            gone = step.kind in ("render", "reference") and step.tool == "vox-render" and not self.there(step)
            if not self.records.final(step) or (gone and self.records.done(step)):
                want(step)
        return list(needed.values())

    def there(self, step):
        return not step.output or os.path.exists(pictures(step, self.records.work))

    def start_some(self):
        free = self.threads - sum(process.threads for process in self.running)
        for step in list(self.waiting):
            if any(need in self.waiting or any(need is process.step for process in self.running) for need in step.needs):
                continue
            broken = next((need for need in step.needs if not self.records.done(need)), None)
            if broken is not None:
                self.waiting.remove(step)
                self.skip(step, broken)
                continue
            wanted = min(step.threads or self.threads, self.threads)
            if wanted > free:
                continue
            self.waiting.remove(step)
            free -= wanted
            self.start(step, wanted)

    def start(self, step, threads):
        options = ["--force", "--progress", "never", f"--max-memory={self.memory}"]
        if not any(word == "--threads" or word == "-j" for word in step.words):
            options += ["--threads", str(threads)]
        command = step.command(self.records.work, options)
        command[0] = self.build.program(step.tool)
        self.running.append(Process(step, command, threads, self.records.work, self.spec.folder))

    def skip(self, step, broken):
        """What it needs failed: it is not tried."""
        error = self.records.find(broken)["error"]
        code = self.records.find(broken)["exit_code"]
        self.end(step, {"schema": 1, "step": step.kind, "command": step.shown(), "status": "failed", "exit_code": code,
                        "error": error, "seconds": 0.0, "cpu_seconds": 0.0, "peak_rss_bytes": 0})

    def collect(self):
        for process in list(self.running):
            record = process.ended()
            if record is None:
                if self.spec.timeout and time.monotonic() - process.start > self.spec.timeout and not process.late:
                    process.late = True
                    process.stop(signal.SIGKILL)
                continue
            self.running.remove(process)
            if record["status"] == "done":
                record = faster(process.best, record)
                if process.run < process.step.repeat:
                    self.again(process, record)
                    continue
            self.ran += 1
            self.end(process.step, record)

    def again(self, process, best):
        """Runs a step once more, where it ran before."""
        self.running.append(Process(process.step, process.command, process.threads, self.records.work, self.spec.folder))
        self.running[-1].run, self.running[-1].best = process.run + 1, best

    def end(self, step, record):
        if step.kind == "decode" and step.output:
            self.remove(step)
        self.records.store(step, record)
        self.finished += 1
        for need in step.needs:
            self.remove_served(need)
        self.on_end(step, record, self.finished, self.total)

    def remove_served(self, step):
        """A compressed file goes when all that read it is done."""
        users = self.users.get(step.name, [])
        if step.output.endswith((".svmm", ".vqv", ".dagc")) and not self.spec.keep and self.records.done(step) and \
                all(self.records.done(user) for user in users):
            self.remove(step)

    def remove(self, step):
        path = os.path.join(self.records.work, step.output)
        if os.path.exists(path):
            os.unlink(path)

    def stop_all(self):
        for process in self.running:
            process.stop()
        deadline = time.monotonic() + 5
        for process in self.running:
            while process.ended() is None:
                if time.monotonic() > deadline:
                    process.stop(signal.SIGKILL)
                time.sleep(0.01)
            if process.step.kind == "decode":
                self.remove(process.step)
        self.running = []

