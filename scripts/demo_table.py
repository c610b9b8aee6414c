#!/usr/bin/env python3
"""Prints the results of scripts/demo as a table: demo_table.py RESULT:COMMAND...

Reads RESULT.{encode,decode,diff,render}.json; COMMAND is only printed.
"""
import json
import sys

COLUMNS = ("volume", "compressed by", "MB", "percent", "bits/voxel", "PSNR dB", "greatest error", "encode MB/s",
           "decode Mvoxel/s", "ms a frame", "original's", "picture's dB", "MS-SSIM")


def load(result, step):
    with open(f"{result}.{step}.json", encoding="utf-8") as file:
        return json.load(file)


def row(argument):
    result, command = argument.split(":", 1)
    encode, decode, diff, render = (load(result, step) for step in ("encode", "decode", "diff", "render"))
    x, y, z = encode["dims"]
    return (encode["input"].removesuffix(".nrrd"), command, f"{encode['file_bytes'] / 1e6:.2f}",
            f"{encode['percent']:.1f}", f"{encode['bits_per_voxel']:.2f}", f"{float(diff['psnr_db']):.2f}",
            f"{diff['max_abs_error']:g}", f"{encode['input_mb_per_s']:.0f}",
            f"{x * y * z / 1e6 / decode['decode_seconds']:.0f}", f"{render['ms_min']:.0f}",
            f"{render['reference']['ms_min']:.0f}", f"{float(render['psnr_db_avg']):.2f}", f"{render['ms_ssim_avg']:.5f}")


rows = [COLUMNS] + [row(argument) for argument in sys.argv[1:]]
widths = [max(len(cells[i]) for cells in rows) for i in range(len(COLUMNS))]
for cells in rows:
    print(cells[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(cells[1:], widths[1:])), sep="  ")
