"""scores.json as other commands read it; `evaluate` writes it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from msgspec import Struct

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.files.validation.fields import Count, Number, checked


class _Spread(Struct):
    median: Number | None = None


class _Survival(Struct):
    """Earlier versions have no least number of frames."""

    frames: Count
    frames_median: Number
    of: Count
    phases: Count
    phases_of: Count
    frames_min: Count | None = None


class _Fit(Struct, frozen=True):
    """R² is a large negative number where a joint hardly moves."""

    r2: Number | None = None
    r2_upright: Number | None = None
    rmse_deg: Number | None = None
    max_gap_deg: Number | None = None
    nrmse_fit: Number | None = None
    cmc: Number | None = None
    r: Number | None = None


class _FitOfPhases(Struct, frozen=True):
    r2: _Spread | None
    r2_upright: _Spread | None
    rmse_deg: _Spread | None


class _Phases(Struct):
    knee: _FitOfPhases
    hip: _FitOfPhases


class _Fits(Struct):
    knee: _Fit
    hip: _Fit
    phases: _Phases


class _RootOfPhases(Struct):
    speed_ratio: _Spread | None
    path_error_m: _Spread | None


class _Root(Struct):
    phases: _RootOfPhases
    reference_advance_m: Number
    reference_path_m: Number | None = None
    speed_ratio: Number | None = None
    path_error_m: Number | None = None


class _Torque(Struct, frozen=True):
    peak: Number | None = None


class _Train(Struct):
    samples: Count | None = None
    budget: Count | None = None
    finished: bool | None = None
    preset: str | None = None
    seed: int | None = None


class _Motion(Struct, frozen=True):
    cyclic: bool = True
    kind: str = ""
    findings: list[str] = []


class _Inputs(Struct):
    motion: str
    policy: str


class _Provenance(Struct):
    inputs: _Inputs


class _Scores(Struct):
    survival: _Survival
    fit: _Fits
    root: _Root
    train: _Train
    provenance: _Provenance
    torque: _Torque = _Torque()
    motion: _Motion = _Motion()


class _Group(Struct):
    split: str
    kind: str
    motions: Count
    whole: Number
    succeeded: Number
    mpjpe_l_mm: Number | None
    r2_knee: Number | None
    r2_hip: Number | None


class _TrackerScores(Struct):
    summary: list[_Group]


def read_tracker_scores(path: Path) -> dict[str, Any]:
    """The content of tracker_scores.json; KinemimicError names the first field that cannot be used."""
    document = read_json(path)
    if not isinstance(document, dict):
        raise KinemimicError(f"{path}: expected the scores of `evaluate-tracker`, found other JSON")
    return checked(document, _TrackerScores, path, advice="run `evaluate-tracker` again")


def read_scores(path: Path) -> dict[str, Any]:
    """The content of scores.json; KinemimicError names the first field that other commands cannot use."""
    advice = "run `evaluate` again"
    document = read_json(path)
    if not isinstance(document, dict):
        raise KinemimicError(f"{path}: expected the scores of `evaluate`, found other JSON; {advice}")
    return checked(document, _Scores, path, advice=advice)
