"""`kinemimic library`: one set of arrays with the motions of many captures, split by subject."""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from kinemimic.evaluate.batch.batch import TIMEOUT, batch
from kinemimic.evaluate.batch.command import STAGE_OPTIONS
from kinemimic.evaluate.batch.sources import paths_of, run_folders
from kinemimic.evaluate.workflow.start import for_tracker
from kinemimic.pipeline.cli.finite_range import FiniteRange
from kinemimic.pipeline.cli.options import jobs_option, json_option, out_option, seed_option
from kinemimic.pipeline.cli.passed_on import passed_on, stage_options
from kinemimic.pipeline.cli.terminal import show
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.retarget.dataset.split import SUBJECT, subject_in, subject_pattern

if TYPE_CHECKING:
    from kinemimic.retarget.humanoid.motion import Motion
    from kinemimic.retarget.library.motion_library import Entry


def library(
    sources: Sequence[Path],
    out: Path,
    *,
    subject: str = SUBJECT,
    test: Collection[str] = (),
    variants: int = 0,
    exercises: int = 0,
    seed: int = 0,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    jobs: int = 1,
    timeout: float = TIMEOUT,
) -> dict[str, Any]:
    """Make the motions of all captures at `sources` and collect the accepted ones in a library at `out`.

    subject: regular expression of the person in a file's name without ending, from its beginning: the first
    group, or all that matches; test: subjects that are left out of the split "train"; variants: number of
    variants of the loops in the split "train" to add, and exercises of exercises on the spot, both random and
    drawn from `seed` (`variants.py`); sources, options, jobs, timeout: as for `batch`, which writes
    its run folders below out/runs. Returns the content of library.json.
    KinemimicError without an accepted motion, for a name that does not match, for an unknown subject, and for
    variants without a loop. If no file has a matching name, or that of a subject, no capture is processed.
    """
    # Import cost: these load the stages.
    from kinemimic.evaluate.batch.row import ACCEPTED  # noqa: PLC0415
    from kinemimic.evaluate.library.variants import made_variants  # noqa: PLC0415
    from kinemimic.retarget.formats.motion_json import read_motion_json  # noqa: PLC0415
    from kinemimic.retarget.library.library_file import write_library  # noqa: PLC0415
    from kinemimic.retarget.library.motion_library import MotionLibrary  # noqa: PLC0415

    pattern, options = subject_pattern(subject), for_tracker(options or {})
    runs = out / "runs"
    _require_subjects([*run_folders(paths_of(sources), runs)], pattern, test)
    rows = batch(sources, runs, options=options, jobs=jobs, timeout=timeout, dataset=False)["captures"]
    if not rows:
        raise KinemimicError(f"{sources[0]}: expected captures, found none")
    subjects = {row["file"]: _subject(Path(row["file"]).name, pattern) for row in rows}
    _require_known(test, subjects.values())
    accepted = [row for row in rows if row["status"] == ACCEPTED]
    if not accepted:
        raise KinemimicError(
            f"{out}: expected at least one accepted motion, found {len(rows)} captures "
            f"without one; {runs / 'batch.csv'} has the reasons"
        )
    motions = [read_motion_json(Path(row["folder"]) / "motion.json") for row in accepted]
    entries = [
        _entry(row, motion, subjects[row["file"]], runs, test)
        for row, motion in zip(accepted, motions, strict=True)
    ]
    made = made_variants(motions, entries, variants, exercises, seed, jobs)
    config = {"subject": subject, "test": sorted(test), "variants": variants, "exercises": exercises}
    inputs = {row["file"]: row["sha256"] for row in accepted if row["sha256"]}
    described = {
        "subject": subject,
        "splits": _splits(entries),
        "variants": dict(Counter(entry.kind for _, entry in made)),
        "refused": {row["file"]: row["reason"] for row in rows if row["status"] != ACCEPTED},
        "motions": _origins(accepted, motions, [motion for motion, _ in made]),
        "provenance": provenance("library", inputs=inputs, config={**config, **options}, seed=seed),
    }
    motions += [motion for motion, _ in made]
    entries += [entry for _, entry in made]
    return write_library(out, MotionLibrary.of(motions, entries), described)


def _origins(
    rows: Sequence[Mapping[str, Any]], motions: Sequence[Motion], variants: Sequence[Motion]
) -> list[dict[str, Any]]:
    """Where each motion of the library comes from; `rows` and `motions` of the accepted captures match."""
    captured = [
        {"file": row["file"], "sha256": row["sha256"], "motion": motion.identity}
        for row, motion in zip(rows, motions, strict=True)
    ]
    return [*captured, *({"motion": motion.identity} for motion in variants)]


def _splits(entries: Sequence[Entry]) -> dict[str, Any]:
    """Subjects and numbers of motions of each kind, by split."""
    splits = {split: [one for one in entries if one.split == split] for split in ("train", "test")}
    return {
        split: {
            "subjects": sorted({one.subject for one in members}),
            "motions": dict(Counter(one.kind for one in members)),
        }
        for split, members in splits.items()
    }


def _require_subjects(files: Sequence[Path], pattern: re.Pattern[str], test: Collection[str]) -> None:
    """KinemimicError if no file's name has a person, or none has one of `test`. Which files are captures is
    not known yet: other names without a person are not an error here."""
    found = {file: subject for file in files if (subject := subject_in(file.name, pattern)) is not None}
    if files and not found:
        raise _without_subject(files[0].name)
    if files and set(test) - set(found.values()):
        _require_known(test, {subject for file, subject in found.items() if _is_capture(file)})


def _is_capture(file: Path) -> bool:
    from kinemimic.pipeline.readers.recognise import open_capture, reader_of  # noqa: PLC0415

    try:
        reader_of(open_capture(file))
    except (KinemimicError, OSError):
        return False
    return True


def _require_known(test: Collection[str], subjects: Collection[str]) -> None:
    if unknown := set(test) - set(subjects):
        known = ", ".join(sorted(set(subjects)))
        raise KinemimicError(f"--test: expected subjects of the captures ({known}), found {min(unknown)!r}")


def _subject(name: str, pattern: re.Pattern[str]) -> str:
    found = subject_in(name, pattern)
    if found is None:
        raise _without_subject(name)
    return found


def _without_subject(name: str) -> KinemimicError:
    return KinemimicError(
        f"--subject: expected a regular expression that finds a person in every file's name, found none in "
        f"{name!r}"
    )


def _entry(row: Mapping[str, Any], motion: Motion, subject: str, runs: Path, test: Collection[str]) -> Entry:
    from kinemimic.retarget.library.motion_library import Entry  # noqa: PLC0415 (import cost)

    x, y, z = (float(value) for value in motion.cycle_offset)
    return Entry(
        # The run folder, since it has the capture's path below what all sources share.
        name=os.path.relpath(row["folder"], runs),
        subject=subject,
        kind=row["kind"],
        split="test" if subject in test else "train",
        rate=float(motion.rate),
        frames=len(motion.root),
        cyclic=bool(motion.cyclic),
        cycle_offset=(x, y, z),
        simulated=motion.simulated,
    )


@click.command("library")
@click.argument("sources", nargs=-1, required=True, metavar="SOURCE...",
                type=click.Path(path_type=Path))  # fmt: skip
@out_option("Folder of the library; its run folders are in OUT/runs.")
@click.option("--subject", metavar="REGEX", default=SUBJECT, show_default=True,
              help="Matches the subject at the start of a file's name; the subject is the first group, or "
                   "the whole match.")  # fmt: skip
@click.option("--test", metavar="SUBJECT", multiple=True,
              help="Put this subject's motions into the split `test`; repeatable.")  # fmt: skip
@click.option("--variants", type=click.IntRange(min=0), default=0, show_default=True,
              help="Add this many random variants of the loops in the split `train`: other cadences, "
                   "strides, postures; walks that turn.")  # fmt: skip
@click.option("--exercises", type=click.IntRange(min=0), default=0, show_default=True,
              help="Add this many random exercises on the spot: squats, bends, reaches, steps.")  # fmt: skip
@seed_option("Random seed of variants and exercises.")
@jobs_option("Captures processed in parallel.")
@click.option("--timeout", type=FiniteRange(min=0, min_open=True), default=TIMEOUT, show_default=True,
              help="Seconds allowed for one capture.")  # fmt: skip
@json_option("Print library.json.")
def command(
    sources: tuple[Path, ...],
    out: Path,
    subject: str,
    test: tuple[str, ...],
    variants: int,
    exercises: int,
    seed: int,
    jobs: int | None,
    timeout: float,
    as_json: bool,
    **options: Any,
) -> None:
    """Build one motion library from every capture at SOURCE, given as for `batch`.

    Every capture goes through ingest, convert and retarget as with `batch`. The library holds the motions
    that `train` accepts, as library.json and library.safetensors. It is split by subject: no subject is in
    both splits.

    \b
      kinemimic library recordings/ --out runs/library --test 07 --test 09
      kinemimic library walks/ --out runs/library --subject '(Person\\d+)_'
    """
    manifest = library(
        sources,
        out,
        subject=subject,
        test=test,
        variants=variants,
        exercises=exercises,
        seed=seed,
        options=stage_options(STAGE_OPTIONS, options),
        jobs=jobs or len(os.sched_getaffinity(0)),
        timeout=timeout,
    )
    if as_json:
        click.echo(json.dumps(manifest, indent=2))
        return
    from kinemimic.evaluate.library.table import tables  # noqa: PLC0415 (import cost)

    show(*tables(manifest))
    click.echo(f"\nlibrary: {out / 'library.json'}, {out / 'library.safetensors'}")


command.params[-1:-1] = passed_on(STAGE_OPTIONS)
