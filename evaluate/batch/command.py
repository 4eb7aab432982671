"""The command `kinemimic batch`."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import click

from kinemimic.evaluate.batch.batch import MEMORY_GIB, TIMEOUT, batch, found_nothing
from kinemimic.evaluate.batch.task import TARGETS
from kinemimic.pipeline.cli.finite_range import FiniteRange
from kinemimic.pipeline.cli.main import BAD_INPUT
from kinemimic.pipeline.cli.options import Decorator, jobs_option, json_option, out_option, ray_option
from kinemimic.pipeline.cli.passed_on import passed_on, stage_options
from kinemimic.pipeline.cli.terminal import show
from kinemimic.pipeline.filters.options import ingest_options
from kinemimic.pipeline.parallel.cluster import cluster
from kinemimic.pipeline.parallel.node_identity import NodeIdentity
from kinemimic.pipeline.parallel.ray_executor import RayExecutor
from kinemimic.retarget.options import retarget_options
from kinemimic.train.sim.engines import engine_identity

STAGE_OPTIONS: Mapping[str, Decorator] = {"ingest": ingest_options, "retarget": retarget_options}


@click.command("batch")
@click.argument("sources", nargs=-1, required=True, metavar="SOURCE...")
@out_option("Folder of the run folders, the table, the data set and its page.")
@click.option("--to", type=click.Choice(list(TARGETS)), default="motion", show_default=True,
              help="Last result: quaternions, the motion, or the scores of the tracker on it.")  # fmt: skip
@click.option("--subject", metavar="REGEX",
              help="Matches the subject at the start of a file's name; the subject is the first group, or "
                   "the whole match. Default: that of the last call, at first up to the first "
                   "underscore.")  # fmt: skip
@jobs_option("Captures processed in parallel.")
@click.option("--timeout", type=FiniteRange(min=0, min_open=True), default=TIMEOUT, show_default=True,
              help="Seconds allowed for one capture.")  # fmt: skip
@click.option("--limit-memory", "memory", type=FiniteRange(min=0.5), metavar="GIB", default=MEMORY_GIB,
              show_default=True, help="Memory allowed for one capture.")  # fmt: skip
@ray_option
@click.option("--overwrite", is_flag=True, help="Also process captures whose result is up to date.")
@json_option("Print batch.json.")
def command(
    sources: tuple[str, ...],
    out: Path,
    to: str,
    subject: str | None,
    jobs: int | None,
    timeout: float,
    memory: float,
    ray: str | None,
    overwrite: bool,
    as_json: bool,
    **options: Any,
) -> int:
    """Make a data set of the motions of every capture at SOURCE.

    SOURCE: a file, a folder with all its subfolders, a pattern ("walks/**/*.bvh"), a name in the catalogue,
    or @FILE, a list of these. Every capture goes through ingest, convert and retarget, or up to the result
    of --to, in its own run folder below --out. The table says which motions `train` accepts, and why the
    others were refused. Captures whose result is up to date are skipped. Exit status: 0 if any capture is
    accepted, else 2.

    \b
      kinemimic batch recordings/ --out runs/recordings
      kinemimic batch walk.skl run.bvh --out runs/both --as-recorded
      kinemimic batch @captures.txt --out runs/scored --to performed
      kinemimic batch recordings/ --out runs/recordings --ray
    """
    if ray is not None and jobs is not None:
        raise click.UsageError("--jobs: expected none with --ray, which uses every core of the cluster")
    with nullcontext() if ray is None else cluster(ray):
        result = batch(
            sources,
            out,
            options=stage_options(STAGE_OPTIONS, options),
            to=to,
            subject=subject,
            jobs=jobs or len(os.sched_getaffinity(0)),
            timeout=timeout,
            memory=memory,
            overwrite=overwrite,
            executor=None if ray is None else _on_nodes(timeout, memory, to),
        )
    if as_json:
        click.echo(json.dumps(result, indent=2))
    elif not result["captures"]:
        raise found_nothing(sources, result)
    else:
        from kinemimic.evaluate.batch.table import tables  # noqa: PLC0415 (import cost)

        show(*tables(result["captures"], result["counts"]))
        click.echo(f"\nbatch: {out / 'batch.json'}, {out / 'batch.csv'}")
        click.echo(f"data set: {out / 'dataset'} (page: {out / 'index.html'})")
    return 0 if result["counts"]["accepted"] else BAD_INPUT


def _on_nodes(timeout: float, memory: float, to: str) -> RayExecutor:
    """Of all captures, only those that are performed depend on the engine of a node."""
    identity = partial(engine_identity, "auto") if to == "performed" else NodeIdentity.here
    return RayExecutor(timeout, int(memory * 2**30), identity=identity)


command.params[-1:-1] = passed_on(STAGE_OPTIONS)
