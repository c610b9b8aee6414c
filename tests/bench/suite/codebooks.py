"""K-means of bricks beside that of faiss."""
import json

from contest import ratio_of
from data import SKULL, skull
from process import run
from table import Row


def kmeans(options, table, add):
    table("K-means", "bench_vq_kmeans: one of 16 different bricks of the CT; ours until nothing changes, faiss for 10 iterations with its own "
          "seeding, as many threads.", ["data", "what", "setting", "iterations", "s", "its time / ours", "PSNR"])
    if not SKULL.exists():
        options.left_out.append("a CT (invesalius-examples)")
        return
    said = [json.loads(run(options.bin / "bench_vq_kmeans", skull(options), "--reduce", 16, "--json").output) for _ in range(2)]
    if "faiss" not in said[0]:
        options.left_out.append("faiss (libfaiss-dev)")
    for what in ("ours", "faiss"):
        if what not in said[0]:
            continue
        ratio = ratio_of([one[what]["seconds"] for one in said], [one["ours"]["seconds"] for one in said])
        seconds = min(one[what]["seconds"] for one in said)
        row = Row("kmeans", "skull", what, "1:16", {"psnr_db": said[0][what]["psnr_db"]},
                  {"encode_s": seconds, "encode_ratio": ratio.median, "encode_ratio_least": ratio.least,
                   "encode_ratio_greatest": ratio.greatest})
        add(row, ["skull", what, "1:16", said[0][what]["iterations"], f"{seconds:.3g}", ratio, f"{said[0][what]['psnr_db']:.2f}"])
