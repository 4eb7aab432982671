"""Stage 1: a capture file into the run folder, divided into passes, cleaned, with a report of its quality."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from kinemimic.pipeline.cli.options import json_option, run_option
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.sidecars import note_path, read_note, read_truth, truth_path
from kinemimic.pipeline.files.store import copy_file, read_json, write_clip, write_json
from kinemimic.pipeline.filters.clean import clean
from kinemimic.pipeline.filters.options import FILTERS, ingest_options
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.quality.report import quality_report, quality_table
from kinemimic.pipeline.readers.recognise import read


def ingest(capture: Path, run: Path, *, filter_name: str | None = None, unit: str | None = None) -> Clip:
    """Read a capture and write raw.parquet, clip.parquet, quality.json (and truth.parquet) to the run folder.

    filter_name: one of FILTERS; by default the one that `make bench-clean` found best; unit: as in `read`.
    raw.parquet holds the frames as recorded but for what the rules repaired (sides, axes, units; unfiltered,
    gaps NaN); clip.parquet the same frames cleaned; quality.json every defect, repaired or flagged.
    A file NAME.truth.parquet beside the capture NAME.* marks it as simulated and is copied; what
    NAME.provenance.json says of how the capture was made goes into the clip's provenance.
    Raises CaptureError, before anything is written, for a file that is no capture of a person or is refused
    by a rule.
    """
    if filter_name is not None and filter_name not in FILTERS:
        raise KinemimicError(f"expected a filter among {', '.join(FILTERS)}, found {filter_name!r}")
    recorded = read(capture, unit=unit)
    truth, note = truth_path(capture), read_note(note_path(capture))
    simulated = read_truth(truth) is not None
    examination = check_capture(recorded)
    if examination.refused is not None:
        raise CaptureError(capture, expected="a person's movement", found=examination.refused.text)
    chosen = filter_name or FILTERS[0]
    config = {"filter": chosen} if unit is None else {"filter": chosen, "unit": unit}
    made_by = provenance("ingest", inputs={"capture": recorded.provenance["sha256"]}, config=config)
    raw = replace(
        examination.clip,
        provenance={
            **note,
            **recorded.provenance,
            "simulated": simulated or bool(note.get("simulated")),
            **made_by,
        },
    )
    cleaned, cleaning = clean(raw, chosen)
    report = quality_report(raw, examination.acquisition, cleaning, examination.defects)
    write_clip(run / "raw.parquet", raw)
    write_clip(run / "clip.parquet", cleaned)
    if simulated:
        copy_file(truth, run / "truth.parquet")
    else:
        # Another capture's truth must not be taken for this one's.
        (run / "truth.parquet").unlink(missing_ok=True)
    write_json(run / "quality.json", report)
    return cleaned


@click.command()
@click.argument("capture", required=False, type=click.Path(path_type=Path))
@run_option()
@ingest_options
@json_option("Print the quality report as JSON.")
def command(
    capture: Path | None, run: Path, filter_name: str | None, unit: str | None, as_json: bool
) -> None:
    """Read CAPTURE (what `kinemimic formats` lists), divide it into passes, clean it, report its quality.

    Without CAPTURE, what a virtual Kinect records of the stock walk.

    \b
      kinemimic ingest walk.skl --run runs/walk
      kinemimic ingest walk.skl --run runs/walk --filter butterworth
      kinemimic ingest child.bvh --run runs/child --unit cm
    """
    if capture is None:
        from kinemimic.pipeline.virtual_kinect.recorder import record_virtual  # noqa: PLC0415 (nobody else waits for it)

        capture = record_virtual(run / "capture").euler
    ingest(capture, run, filter_name=filter_name, unit=unit)
    report: dict[str, Any] = read_json(run / "quality.json")
    if as_json:
        click.echo(json.dumps(report, indent=2))
    else:
        Console(highlight=False, markup=False).print(quality_table(report), crop=False)
