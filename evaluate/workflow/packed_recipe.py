"""Recipes of policies on an executor that shares no disk: run folders go there and come back as bytes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from kinemimic.evaluate.policies.recipe import Recipe
from kinemimic.evaluate.workflow.run import run
from kinemimic.pipeline.errors import KinemimicError, one_line
from kinemimic.pipeline.parallel.executor import Executor
from kinemimic.pipeline.parallel.packed_files import PackedFiles, read_files, read_folder, write_files
from kinemimic.pipeline.parallel.task_pool import Failure
from kinemimic.pipeline.readers.search import files_to_read
from kinemimic.pipeline.run_folder.lock import locked
from kinemimic.pipeline.run_folder.record import RUN_FILE


@dataclass(frozen=True)
class PackedRecipe:
    """A recipe with what its training needs.

    capture: name of its file, None for the virtual Kinect's; files: of the capture and beside it; teachers:
    of the recipe's, if it has any; run: of the run folder, if there is one; engine: a resolved name from
    `train/sim/engines.py`.
    """

    recipe: Recipe
    capture: str | None
    files: PackedFiles
    teachers: PackedFiles
    run: PackedFiles
    engine: str


@dataclass(frozen=True)
class TrainedRecipe:
    """The files of the run folder after the training; refused: the error that ended it, in one line."""

    files: PackedFiles
    refused: str | None


def stage_options(
    recipe: Recipe, engine: str | None, workers: int | None = None, *, teachers: Path | None
) -> Mapping[str, Mapping[str, Any]]:
    """The options of a recipe's stages, as `run` takes them; teachers: folder of the recipe's."""
    trained = {"preset": recipe.preset, "from": recipe.start, "seed": recipe.seed}
    trained |= {"budget": recipe.budget} if teachers is None else {"teachers": str(teachers)}
    common = {"engine": engine, "workers": workers}
    return {"train": {**trained, **common}, "evaluate": common}


def train_packed(packed: PackedRecipe) -> TrainedRecipe:
    """Take a recipe through all stages in a temporary folder of this machine, on one core."""
    with TemporaryDirectory(prefix="kinemimic-") as place:
        captures, folder, teachers = (Path(place) / name for name in ("in", "run", "teachers"))
        write_files(captures, packed.files)
        write_files(teachers, packed.teachers)
        write_files(folder, packed.run, last=lambda name: name == RUN_FILE)
        capture = None if packed.capture is None else captures / packed.capture
        options = stage_options(
            packed.recipe, packed.engine, workers=1, teachers=teachers if packed.teachers else None
        )
        refused = None
        try:
            run(capture, folder, options=options, quiet=True)
        except (KinemimicError, OSError) as error:
            refused = one_line(error)
        return TrainedRecipe(read_folder(folder) if folder.exists() else {}, refused)


def train_recipes_on(
    executor: Executor, recipes: Sequence[Recipe], sources: Sequence[Path | None], runs: Path, engine: str
) -> Iterator[tuple[Recipe, str | None]]:
    """Train recipes into their run folders below `runs`; (recipe, error in one line or None) as they finish.

    sources: the capture of each, None for the virtual Kinect's. What the run folders have is sent along, and
    a recipe that fails does not affect the others. KinemimicError for a capture that is too large to send.
    """

    def packed() -> Iterator[PackedRecipe]:
        for recipe, source in zip(recipes, sources, strict=True):
            folder = runs / recipe.name
            yield PackedRecipe(
                recipe,
                None if source is None else source.name,
                {} if source is None else read_files(files_to_read(source)),
                {} if recipe.teachers_folder is None else read_folder(recipe.teachers_folder),
                read_folder(folder) if folder.exists() else {},
                engine,
            )

    for index, outcome in executor.map(train_packed, packed()):
        recipe = recipes[index]
        if isinstance(outcome, Failure):
            yield recipe, outcome.reason
            continue
        refused = outcome.refused
        try:
            with locked(runs / recipe.name):
                write_files(runs / recipe.name, outcome.files, last=lambda name: name == RUN_FILE)
        except (KinemimicError, OSError) as error:
            refused = one_line(error)
        yield recipe, refused
