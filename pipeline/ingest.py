"""Stage 1: read a capture, check its quality, divide it into passes, clean it, write it to the run folder."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from kinemimic.pipeline.cli.options import json_option, overwrite_option, run_option
from kinemimic.pipeline.cli.terminal import show
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.sidecars import note_path, read_note, read_truth, truth_path
from kinemimic.pipeline.files.stages import LANDMARKS_FILE, VIRTUAL_CAPTURE
from kinemimic.pipeline.files.store import copy_file, read_json, write_clip, write_json
from kinemimic.pipeline.filters.clean import clean
from kinemimic.pipeline.filters.options import FILTERS, ingest_options
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.quality.report import quality_report, quality_table
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.readers.video.container import is_video
from kinemimic.pipeline.readers.video.options import VideoOptions
from kinemimic.pipeline.run_folder.capture import capture_files, default_run, require_same_capture
from kinemimic.pipeline.run_folder.lock import locked
from kinemimic.pipeline.run_folder.stage import stage


def ingest(
    capture: Path,
    run: Path,
    *,
    filter_name: str | None = None,
    unit: str | None = None,
    rate: float | None = None,
    video: VideoOptions | None = None,
    overwrite: bool = False,
) -> Clip:
    """Read a capture and write raw.parquet, clip.parquet, quality.json (and truth.parquet) to the run folder.

    filter_name: one of FILTERS, by default the best one in `make bench-clean`; unit, rate, video: as in
    `read`. The landmarks of a video are kept in landmarks.npz, so that an interrupted call can resume.
    raw.parquet: the frames as recorded, except for repairs by the rules (sides, axes, units), unfiltered,
    with NaN in gaps; clip.parquet: the same frames after cleaning; quality.json: every defect.
    A sidecar file NAME.truth.parquet marks a capture NAME.* as simulated and is copied; the content of
    NAME.provenance.json goes into the clip's provenance.
    CaptureError, before anything is written, for a file that is not a capture of a person or that a rule
    refuses; KinemimicError if the folder has the results of another capture, unless `overwrite` is set: they
    are then set aside.
    """
    if filter_name is not None and filter_name not in FILTERS:
        raise KinemimicError(f"expected a filter among {', '.join(FILTERS)}, found {filter_name!r}")
    if is_video(capture):
        if not overwrite:
            require_same_capture(run, capture)  # before minutes of work
        with locked(run):
            recorded = read(capture, unit=unit, rate=rate, video=video, landmarks=run / LANDMARKS_FILE)
    else:
        recorded = read(capture, unit=unit, rate=rate, video=video)
    truth, note = truth_path(capture), read_note(note_path(capture))
    simulated = read_truth(truth) is not None
    checked = check_capture(recorded)
    if checked.refused is not None:
        raise CaptureError(capture, expected="a person's movement", found=checked.refused.text)
    chosen = filter_name or FILTERS[0]
    given = {"unit": unit, "rate": rate, **({} if video is None else video.given())}
    config = {"filter": chosen, **{name: value for name, value in given.items() if value is not None}}
    made_by = provenance("ingest", inputs={"capture": recorded.provenance["sha256"]}, config=config)
    raw = replace(
        checked.clip,
        provenance={
            **note,
            **recorded.provenance,
            "sensor": note.get("sensor", recorded.provenance["sensor"]),
            "simulated": simulated or bool(note.get("simulated")),
            **made_by,
        },
    )
    cleaned, cleaning = clean(raw, chosen)
    report = quality_report(raw, checked.acquisition, cleaning, checked.defects)
    if not overwrite:
        require_same_capture(run, capture)
    with stage(run, "ingest", sources=capture_files(capture, report["sidecar_files"])) as out:
        write_clip(out / "raw.parquet", raw)
        write_clip(out / "clip.parquet", cleaned)
        if simulated:
            copy_file(truth, out / "truth.parquet")
        write_json(out / "quality.json", report)
    return cleaned


@click.command()
@click.argument("capture", required=False, type=click.Path(path_type=Path))
@run_option(default=None)
@overwrite_option
@ingest_options
@json_option("Print the quality report as JSON.")
def command(
    capture: Path | None,
    run: Path | None,
    overwrite: bool,
    filter_name: str | None,
    unit: str | None,
    rate: float | None,
    height: float | None,
    fov: float | None,
    person: int | None,
    pose_model: Path | None,
    as_json: bool,
) -> None:
    """Read CAPTURE, divide it into passes, clean it, and report its quality.

    `kinemimic formats` lists the formats. Without CAPTURE, a virtual Kinect records the stock walk.

    \b
      kinemimic ingest walk.skl --run runs/walk
      kinemimic ingest walk.skl --run runs/walk --filter butterworth
      kinemimic ingest child.bvh --run runs/child --unit cm
      kinemimic ingest treadmill.txt --run runs/treadmill --rate 15
      kinemimic ingest walk.mp4 --height 1.82
    """
    run = run or default_run(capture)
    if capture is None:
        from kinemimic.pipeline.virtual_kinect.recorder import record_virtual  # noqa: PLC0415 (import cost)

        if not overwrite:
            require_same_capture(run, run / VIRTUAL_CAPTURE)
        with stage(run, "virtual") as out:
            record_virtual((out / VIRTUAL_CAPTURE).parent)
        capture = run / VIRTUAL_CAPTURE
    video = VideoOptions(height, fov, person, pose_model)
    ingest(capture, run, filter_name=filter_name, unit=unit, rate=rate, video=video, overwrite=overwrite)
    report: dict[str, Any] = read_json(run / "quality.json")
    if as_json:
        click.echo(json.dumps(report, indent=2))
    else:
        show(quality_table(report))
