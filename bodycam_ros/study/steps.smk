# The steps of a study as rules of Snakemake, one for each: what bodycam_ros/study/step_graph.py has written.
import json

with open(config["graph"]) as file:
    GRAPH = json.load(file)


def inputs_of(step):
    return lambda wildcards: step["inputs"]


def grown(amount):
    """Twice as much with each further attempt."""
    return lambda wildcards, attempt: amount * 2 ** (attempt - 1)


rule all:
    input:
        lambda wildcards: [path for step in GRAPH for path in (step["receipt"], step["main_file"])],


for step in GRAPH:

    rule:
        name:
            step["rule"]
        input:
            inputs_of(step),
        output:
            receipt=step["receipt"],
            # Not removed before the step: what fails leaves the earlier result.
            made=update(step["main_file"]),
        log:
            step["logs"],
        benchmark:
            step["benchmark"]
        params:
            state=step["state"],
        threads: step["threads"]
        resources:
            mem_mb=grown(step["memory_mb"]),
            runtime=grown(step["minutes"]),
        shell:
            # A text of the loop would be that of its last turn by the time that a step runs.
            "exec bash steps/{rule}.sh {threads}"
