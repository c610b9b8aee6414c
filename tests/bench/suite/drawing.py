"""Volumes drawn from their compressed form: first hits beside NanoVDB, through transfer functions beside VTK."""
import json

from contest import ratio_of
from data import SKULL, skull
from process import Failed, run
from table import Row


def rays(options, table, add):
    table("Rays to the first voxel", "bench_nanovdb_rays: 1280 x 720, 4 views, frame by frame in turn, one thread; "
          "*differ*: rays whose first voxel is another one. Ratios are of times, beside SVMM at quality 80: above 1 that is faster.",
          ["data", "what", "setting", "MB", "Mrays/s", "its time / ours", "differ"])
    program = options.bin / "bench_nanovdb_rays"
    if not program.exists():
        options.left_out.append("NanoVDB (libnanovdb-dev)")
        return
    for name in ("menger:5", "menger:6"):
        rounds = [json.loads(run(program, name, "--path", "orbit:4", "--size", "1280x720", "-j", 1, "--json").output)
                  for _ in range(options.rounds if name == "menger:5" else 1)]
        times = {row["name"]: [one["rows"][i]["ms_avg"] for one in rounds] for i, row in enumerate(rounds[0]["rows"])}
        ours = next(key for key in times if "80" in key)
        for i, one in enumerate(rounds[0]["rows"]):
            ratio = ratio_of(times[one["name"]], times[ours])
            rate = sorted(done["rows"][i]["mrays_per_s"] for done in rounds)[len(rounds) // 2]
            row = Row("rays", name, one["name"], "", {"bytes": one["bytes"]},
                      {"rate": rate, "rate_unit": "Mrays/s", "decode_ratio": ratio.median, "decode_ratio_least": ratio.least,
                       "decode_ratio_greatest": ratio.greatest})
            add(row, [name, one["name"], "", f"{one['bytes'] / 1e6:.1f}", f"{rate:.3g}", ratio, one["differing"]])


def volumes(options, table, add):
    table("Direct volume rendering", "vtk_dvr.py: 512 x 512, 4 views, samples half a voxel apart, one thread; time is the median frame's, of "
          "which the fastest round counts. Ratios are VTK's time as a multiple of ours.",
          ["data", "what", "setting", "ms", "VTK / it", "of dense"])
    if not SKULL.exists():
        options.left_out.append("a CT (invesalius-examples)")
        return
    script = options.source / "tests" / "bench" / "vtk_dvr.py"
    transfer = options.source / "tests" / "bench" / "transfer" / "ct-skin.json"
    try:
        said = json.loads(run("/usr/bin/python3", script, "--bin", options.bin, "--sizes", "512x512", "--frames", 4, "--rounds",
                              options.rounds, "--json", f"{skull(options)}:{transfer}").output)
    except Failed as problem:
        options.left_out.append(f"VTK (python3-vtk9, xvfb): {problem}")
        return
    for one in said["rows"]:
        row = Row("dvr", "skull", one["who"], f"light {one['light']}", {},
                  {"decode_s": one["ms_median"] / 1000, "decode_ratio": 1 / one["vtk_ratio"]})
        add(row, ["skull", one["who"], f"light {one['light']}", f"{one['ms_median']:.1f}", f"{one['vtk_ratio']:.2f}",
                  f"{one['dense_ratio']:.2f}"])
