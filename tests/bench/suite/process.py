"""Runs programs one at a time and says what each took.

Programs are started by a small process of its own: what Linux calls the greatest resident set of a program includes that of
whoever started it, so a launcher of 300 MB would hide what a program of 50 MB needs. That process, about 13 MB, is the least
that is ever reported.
"""
import dataclasses
import json
import os
import shlex
import subprocess
import sys
import time


class Failed(Exception):
    """A program that ended with another exit code than 0; says which and why."""


@dataclasses.dataclass
class Run:
    seconds: float  # wall time, from start to end
    cpu_seconds: float
    peak_bytes: int  # greatest resident set
    output: str  # what it wrote on standard output


def serve():
    """The small process: a line of JSON, words and where output goes, for each program, and one in reply."""
    for line in sys.stdin:
        words, target = json.loads(line)
        out_end, out = os.pipe()
        error_end, error = os.pipe()
        actions = [(os.POSIX_SPAWN_OPEN, 0, os.devnull, os.O_RDONLY, 0), (os.POSIX_SPAWN_DUP2, out, 1),
                   (os.POSIX_SPAWN_DUP2, error, 2)]
        if target:
            actions.append((os.POSIX_SPAWN_OPEN, 1, target, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666))
        actions += [(os.POSIX_SPAWN_CLOSE, end) for end in (out_end, out, error_end, error)]
        start = time.perf_counter()
        try:
            child = os.posix_spawnp(words[0], words, os.environ, file_actions=actions)
        except OSError as problem:
            for end in (out_end, out, error_end, error):
                os.close(end)
            print(json.dumps({"code": 127, "message": str(problem)}), flush=True)
            continue
        os.close(out)
        os.close(error)
        output, message = drain(out_end, error_end)
        _, status, usage = os.wait4(child, 0)
        print(json.dumps({"seconds": time.perf_counter() - start, "cpu_seconds": usage.ru_utime + usage.ru_stime,
                          "peak_bytes": usage.ru_maxrss * 1024, "code": os.waitstatus_to_exitcode(status),
                          "output": output, "message": message}), flush=True)


def drain(*ends):
    """What comes out of pipes until all are closed, as texts."""
    import selectors
    texts = {end: b"" for end in ends}
    with selectors.DefaultSelector() as ready:
        for end in ends:
            ready.register(end, selectors.EVENT_READ)
        while ready.get_map():
            for key, _ in ready.select():
                part = os.read(key.fd, 1 << 16)
                texts[key.fd] += part
                if not part:
                    ready.unregister(key.fd)
                    os.close(key.fd)
    return [text.decode(errors="replace") for text in texts.values()]


_server = None


def run(*words, out=None, may_fail=False):
    """Runs a program to its end; what it writes on standard output comes back, or goes to the file `out`. Throws Failed if its exit
    code is not 0, unless that is an answer, too."""
    global _server
    if _server is None:
        _server = subprocess.Popen([sys.executable, "-S", __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    words = list(map(str, words))
    print(json.dumps([words, str(out) if out else None]), file=_server.stdin, flush=True)
    reply = json.loads(_server.stdout.readline())
    if reply["code"] != 0 and not may_fail:
        raise Failed(f"{shlex.join(words)}: exit code {reply['code']}: {reply['message'].strip()}")
    return Run(reply.get("seconds", 0), reply.get("cpu_seconds", 0), reply.get("peak_bytes", 0), reply.get("output", ""))


if __name__ == "__main__":
    serve()
