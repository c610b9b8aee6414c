"""What this process may use of the machine, and what the machine is."""
import math
import os
import platform


def available_threads():
    """As our other programs count: those that this process may run on, and its cgroup's share of them."""
    threads = len(os.sched_getaffinity(0))
    try:
        with open("/sys/fs/cgroup/cpu.max", encoding="ascii") as file:
            quota, period = file.read().split()
        if quota != "max" and int(period) > 0:
            threads = min(threads, math.ceil(int(quota) / int(period)))
    except (OSError, ValueError):
        pass
    return max(threads, 1)


def usable_memory():
    """Bytes: physical memory, or the limit of the cgroup."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    try:
        with open("/sys/fs/cgroup/memory.max", encoding="ascii") as file:
            total = min(total, int(file.read()))
    except (OSError, ValueError):
        pass
    return total


def description():
    """For the tables: what times depend on. No name of the host."""
    cpu = platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            cpu = next((line.partition(":")[2].strip() for line in file if line.startswith("model name")), cpu)
    except OSError:
        pass
    return {"cpu": cpu, "cpus": available_threads(), "memory_bytes": usable_memory(),
            "system": f"{platform.system()} {platform.release()} {platform.machine()}"}
