"""`kinemimic reproduce`: trains the shipped policies from their recipes."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from kinemimic.evaluate.policies.recipe import POLICIES, Recipe, recipes, recording
from kinemimic.evaluate.policies.scores_file import read_scores
from kinemimic.evaluate.policies.shipped import RECORD, SCORES, motion_summary
from kinemimic.evaluate.workflow.packed_recipe import stage_options, train_recipes_on
from kinemimic.evaluate.workflow.run import run as run_stages
from kinemimic.pipeline.catalog.local_files import captures_folder
from kinemimic.pipeline.cli.options import json_option, ray_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import copy_file, file_hash, write_json
from kinemimic.pipeline.parallel.cluster import cluster
from kinemimic.pipeline.parallel.ray_executor import RayExecutor
from kinemimic.retarget.formats.motion_json import MOTION
from kinemimic.train.rollout.policy import POLICY
from kinemimic.train.sim.engines import engine_identity, resolve
from kinemimic.train.sim.options import engine_option

if TYPE_CHECKING:
    from kinemimic.retarget.humanoid.motion import Motion

LARGEST = 4_000_000  # bytes of a shipped file


def capture_of(recipe: Recipe, captures: Path | None) -> Path | None:
    """The capture of a recipe, with its hash checked; None for the virtual Kinect's.

    captures: folder of recordings, COLLECTION/FILE; by default the one of `kinemimic datasets fetch`.
    """
    if recipe.stock is not None:
        from kinemimic.pipeline.readers.mocap.deepmimic import stock_motion  # noqa: PLC0415 (import cost)

        return stock_motion(recipe.stock)
    if recipe.recording is None:
        return None
    wanted = recording(recipe.recording)
    folder = captures_folder(captures)
    path = folder / wanted.collection / wanted.file
    if not path.is_file():
        into = "" if captures is None else f" --into {shlex.quote(str(captures))}"
        raise KinemimicError(
            f"{recipe.name}: expected the recording {wanted.name} in {folder}, found none; "
            f"`kinemimic datasets fetch {wanted.name}{into}` downloads it (licence: {wanted.licence})"
        )
    if file_hash(path) != wanted.sha256:
        raise KinemimicError(f"{path}: expected the recording {wanted.name}, found another file")
    return path


def publish(run: Path, recipe: Recipe, into: Path = POLICIES) -> Path:
    """Copy a trained and evaluated run to the folder of shipped policies; returns the policy's folder.

    The run must match the recipe. The motion of a recording is not copied.
    """
    # Import cost: these load the simulation.
    from kinemimic.retarget.formats.motion_json import read_motion_json  # noqa: PLC0415
    from kinemimic.train.rollout.policy import Policy  # noqa: PLC0415

    _, record = Policy.load(run / POLICY)
    if "motion" not in record["provenance"]["inputs"]:
        raise KinemimicError(
            f"{run / POLICY}: expected a run trained by `train`, found a tracker's policy; train one with "
            f"`kinemimic reproduce --only {recipe.name}`"
        )
    motion, scores = read_motion_json(run / MOTION), read_scores(run / SCORES)
    _require_recipe(run, recipe, motion, record, scores["provenance"]["inputs"]["policy"])
    folder = into / recipe.name
    ships = (POLICY, SCORES) if recipe.recording else (MOTION, POLICY, SCORES)
    if heavy := [name for name in ships if (run / name).stat().st_size > LARGEST]:
        raise KinemimicError(
            f"{run / heavy[0]}: expected at most {LARGEST:,} bytes, found more: too large to ship"
        )
    if recipe.recording:
        (folder / MOTION).unlink(missing_ok=True)
    # The policy last: a folder without one is not listed.
    (folder / POLICY).unlink(missing_ok=True)
    for name in ships:
        if name != POLICY:
            copy_file(run / name, folder / name)
    write_json(folder / RECORD, {**record, "imitates": motion_summary(motion)})
    copy_file(run / POLICY, folder / POLICY)
    return folder


def _require_recipe(
    run: Path, recipe: Recipe, motion: Motion, record: Mapping[str, Any], scored_policy: str
) -> None:
    """KinemimicError unless a run has the recipe's motion and policy, and scores of that policy.

    record: content of policy.json; scored_policy: SHA-256 of the policy that scores.json is of.
    """
    from kinemimic.train.config.from_tracker import NAMES  # noqa: PLC0415 (import cost)

    capture = motion.provenance.get("capture", {})
    expected: dict[str, tuple[Any, Any]] = {
        "preset": (NAMES[recipe.preset] if recipe.start else recipe.preset, record["preset"]),
        "start": (_start(recipe), record["config"].get("start", "")),
        "budget": (recipe.budget, record["config"]["budget"]),
        # Not so if `--minutes` ended the training.
        "budget spent": (True, record["samples"] >= recipe.budget),
        "seed": (recipe.seed, record["seed"]),
        "motion": (motion.identity, record["provenance"]["inputs"]["motion"]),
        "scored policy": (file_hash(run / POLICY), scored_policy),
        "simulated capture": (recipe.stock is None and recipe.recording is None, motion.simulated),
    }
    if recipe.recording is not None:
        expected["recording"] = (recording(recipe.recording).sha256, capture.get("sha256"))
    if recipe.teachers_folder is not None:
        taught_by = record.get("joining", {}).get("teachers")
        expected["teachers"] = (_teachers(recipe.teachers_folder, record), taught_by)
    if recipe.stock is not None:
        expected["stock motion"] = (f"humanoid3d_{recipe.stock}.txt", capture.get("source"))
    for what, (wanted, found) in expected.items():
        if wanted != found:
            raise KinemimicError(
                f"{run}: {what}: expected {wanted!r} as in the recipe {recipe.name!r}, found {found!r}"
            )


def _teachers(folder: Path, record: Mapping[str, Any]) -> str:
    """Content hash of the teachers in a folder, of a policy with this record."""
    from kinemimic.train.config.config import TrainConfig  # noqa: PLC0415 (import cost)
    from kinemimic.train.recovery.teachers import load_teachers  # noqa: PLC0415 (import cost)

    return load_teachers(folder, TrainConfig.from_json(record["config"]).env).identity


def _start(recipe: Recipe) -> str:
    """SHA-256 of the tracker that a policy of this recipe starts from, "" for none."""
    from kinemimic.train.rollout.tracker_file import tracker_path  # noqa: PLC0415 (import cost)

    return file_hash(tracker_path(recipe.start)) if recipe.start else ""


def reproduce(
    wanted: Sequence[Recipe],
    runs: Path,
    into: Path = POLICIES,
    *,
    captures: Path | None = None,
    engine: str | None = None,
    quiet: bool = False,
    ray: str | None = None,
) -> list[Path]:
    """Train policies, each in a run folder below `runs`; returns the folders of the policies.

    As in `kinemimic run`, finished stages are skipped and an interrupted training resumes. Missing recordings
    are reported before any training.
    ray: train on a Ray cluster, a policy per core, at this address or, "local", started on this machine; by
    default one after the other, each on all cores. The policies are those of training with one worker. One
    that fails does not affect the others; KinemimicError names those that failed, at the end.
    """
    sources = [capture_of(recipe, captures) for recipe in wanted]
    for recipe in wanted:
        if recipe.teachers_folder is not None and not recipe.teachers_folder.is_dir():
            raise KinemimicError(
                f"{recipe.name}: expected its teachers in {recipe.teachers_folder}, found none; a clone of "
                "the repository has them, an installed package has not"
            )
    if ray is not None:
        return _on_nodes(ray, wanted, sources, runs, into, engine or "auto", quiet=quiet)
    made: list[Path] = []
    for recipe, source in zip(wanted, sources, strict=True):
        if not quiet:
            echo(f"{recipe.name}: {recipe.description}", bold=True)
        options = stage_options(recipe, engine, teachers=recipe.teachers_folder)
        run_stages(source, runs / recipe.name, options=options, quiet=quiet)
        made.append(publish(runs / recipe.name, recipe, into))
    return made


def _on_nodes(
    ray: str,
    wanted: Sequence[Recipe],
    sources: Sequence[Path | None],
    runs: Path,
    into: Path,
    engine: str,
    *,
    quiet: bool,
) -> list[Path]:
    """As `reproduce`, on a Ray cluster."""
    engine = resolve(engine)
    made: dict[str, Path] = {}
    failed: list[str] = []
    with cluster(ray):
        executor = RayExecutor(isolated=False, identity=partial(engine_identity, engine))
        for recipe, error in train_recipes_on(executor, wanted, sources, runs, engine):
            refused = error
            if refused is None:
                try:
                    made[recipe.name] = publish(runs / recipe.name, recipe, into)
                except KinemimicError as mismatch:
                    refused = str(mismatch)
            if refused is not None:
                failed.append(f"{recipe.name}: {' '.join(refused.split())}")
            if not quiet:
                echo(failed[-1] if refused is not None else f"{recipe.name}: {made[recipe.name]}")
    if failed:
        raise KinemimicError(
            f"expected all policies to be trained, found {len(failed)} of {len(wanted)} that failed: "
            f"{'; '.join(failed)}"
        )
    return [made[recipe.name] for recipe in wanted]


@click.command("reproduce")
@click.option("--only", multiple=True, metavar="NAME", help="Recipe; repeatable. Default: all.")
@click.option(
    "--runs",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("runs/reproduce"),
    show_default=True,
    help="Parent folder of the runs.",
)
@click.option(
    "--captures",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of the recordings. Default: the folder into which `kinemimic datasets fetch` downloads.",
)
@click.option(
    "--from",
    "ready",
    type=click.Path(path_type=Path),
    help="Run folder to publish without training; needs one --only.",
)
@click.option(
    "--into",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("datasets/policies"),
    show_default=True,
    help="Parent folder of the policies.",
)
@ray_option
@engine_option
@json_option("Print the written folders as JSON.")
def command(
    only: tuple[str, ...],
    runs: Path,
    captures: Path | None,
    ready: Path | None,
    into: Path,
    ray: str | None,
    engine: str | None,
    as_json: bool,
) -> None:
    """Train the shipped policies from their recipes, evaluate them, and write them to --into.

    \b
      kinemimic reproduce --only walk
      kinemimic reproduce --only kinect_walk --captures recordings
      kinemimic reproduce --ray 10.0.0.1:6379
    """
    known = recipes()
    if unknown := [name for name in only if name not in known]:
        raise KinemimicError(f"expected a recipe among {', '.join(known)}, found {unknown[0]!r}")
    wanted = [known[name] for name in only] or list(known.values())
    if ready is not None and len(only) != 1:
        raise click.UsageError("--from publishes a single policy: name it with one --only")
    if ready is not None:
        made = [publish(ready, wanted[0], into)]
    else:
        made = reproduce(wanted, runs, into, captures=captures, engine=engine, quiet=as_json, ray=ray)
    if as_json:
        click.echo(json.dumps([folder.as_posix() for folder in made]))
    else:
        echo("\n".join(str(folder) for folder in made))
