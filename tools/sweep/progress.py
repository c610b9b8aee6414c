"""How far the sweep is, on standard error: a line on a terminal, or lines of key=value."""
import sys
import time


class Progress:
    def __init__(self, mode, quiet):
        if quiet or (mode == "auto" and not sys.stderr.isatty()):
            mode = "never"
        self.mode, self.start, self.last, self.shown = mode, time.monotonic(), -1.0, False

    def update(self, done, total, detail):
        now = time.monotonic() - self.start
        end = done == total
        if self.mode == "plain" and (end or now - self.last >= 0.5):
            sys.stderr.write(f"stage=sweep done={done / max(total, 1):.2f} steps={done}/{total}\n")
        elif self.mode == "auto" and now >= 1 and (end or now - self.last >= 0.1):
            sys.stderr.write(f"\rsweep {100 * done // max(total, 1):3d} %, {done} of {total} steps: {detail[:60]}\033[K")
            self.shown = True
        else:
            return
        sys.stderr.flush()
        self.last = now

    def close(self):
        if self.shown:
            sys.stderr.write("\r\033[K")
            self.shown = False
