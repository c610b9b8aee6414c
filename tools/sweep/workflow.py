"""The same sweep as a Snakemake workflow: one job a setting, on this machine or on a cluster."""
import json
import os

TEMPLATE = '''# Written by vox-sweep --snakemake: one job for each setting, then the tables and the page.
#
#   snakemake --cores 4                                    on this machine
#   snakemake --jobs 100 --cluster "sbatch --parsable --cpus-per-task={{threads}} --mem={{resources.mem_mb}}"    on Slurm
#
# A setting that fails is marked in the tables; the others go on.
import shlex

SWEEP = {sweep}
SPEC = {spec}
DATA = {data}
FOLDER = {folder}
CASES = {cases}

workdir: FOLDER

localrules: all, tables

rule all:
    input: "index.html"

rule setting:
    output: touch("settings/{{case}}.finished")
    wildcard_constraints: case="[A-Za-z0-9.-]+"
    threads: {threads}
    resources: mem_mb={mem_mb}
    params:
        command=lambda wildcards, threads, resources: shlex.join(
            [SWEEP, SPEC, *DATA, "-o", FOLDER, "--case", wildcards.case, "--threads", str(threads),
             "--max-memory", str(resources.mem_mb * 3 // 4) + "M", "--quiet"])
    shell: "{{params.command}} || [ $? -eq 1 ]"

rule tables:
    input: expand("settings/{{case}}.finished", case=CASES)
    output: "index.html", "results.csv", "results.jsonl"
    params: command=shlex.join([SWEEP, SPEC, *DATA, "-o", FOLDER, "--collect"])
    shell: "{{params.command}} || [ $? -eq 1 ]"
'''


def text(cases, options, program, threads, memory):
    """The Snakefile. Names of files are absolute: jobs run elsewhere. `threads` and `memory` are those of one job, which
    gives a quarter of its memory to what is not voxels."""
    names = ",\n         ".join(json.dumps(case.name) for case in cases)
    return TEMPLATE.format(sweep=json.dumps(program), spec=json.dumps(os.path.abspath(options.spec)),
                           data=json.dumps(["--data", os.path.abspath(options.data)] if options.data else []),
                           folder=json.dumps(os.path.abspath(options.output)), cases=f"[{names}]", threads=threads,
                           mem_mb=max(memory >> 20, 1))
