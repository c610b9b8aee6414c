"""The inner loops of the libraries, one by one, beside what the machine could do: bench_kernels."""
import json

from process import run
from table import Row


def kernels(options, table, add):
    program = options.bin / "bench_kernels"
    if not program.exists():
        options.left_out.append("kernels (libbenchmark-dev)")
        return
    out = options.output / "kernels.json"
    run(program, f"--benchmark_out={out}")
    said = json.loads(out.read_text(encoding="utf-8"))
    ceilings = [f"{name} {value}" for name, value in said["context"].items() if value and str(value).endswith(("/s", "ns", "GHz"))]
    table("Kernels", "bench_kernels: CPU time of one thread; beside it what no item can do without, measured in the same run. " +
          "; ".join(ceilings) + ".", ["data", "what", "setting", "ns an item", "no less than", "of that", "which is"])
    for one in said["benchmarks"]:
        family, _, setting = one["name"].partition("/")
        row = Row("kernels", "", family, setting, {}, {"rate": one["ns"], "rate_unit": "ns an item"})
        add(row, ["", family, setting, f"{one['ns']:.4g}", f"{one['limit_ns']:.3g}", f"{100 * one['of_limit']:.1f} %", one["label"]])
