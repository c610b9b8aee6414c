"""SIGINT, SIGTERM and SIGHUP: the first one is raised as Interrupted, at a moment that suits."""
import contextlib
import signal

from sweep.failure import Interrupted

NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_state = {"deferred": False, "pending": 0}


def handle():
    """What the parent ignores (nohup) stays ignored."""
    for number in NUMBERS:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _stop)


def _stop(number, _):
    for other in NUMBERS:
        signal.signal(other, signal.SIG_IGN)
    _state["pending"] = number
    if not _state["deferred"]:
        check()


def check():
    """Raises what came while signals were deferred."""
    if _state["pending"]:
        raise Interrupted(_state["pending"])


@contextlib.contextmanager
def deferred():
    """Within, signals wait for check()."""
    _state["deferred"] = True
    try:
        yield
    finally:
        _state["deferred"] = False
