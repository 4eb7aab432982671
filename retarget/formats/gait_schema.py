"""The fields of gait.json that later stages read."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from kinemimic.pipeline.files.validation.fields import Count, Interval, Number, Share

_PerSide = dict[str, Share | None]


class _Finding(Struct):
    rule: str
    severity: str = ""
    message: str = ""
    value: Number | None = None
    limit: Number | None = None


class _Path(Struct):
    source: Literal["recorded", "feet"]
    disagreement: Number | None


class _Bout(Struct):
    start_s: Number | None
    end_s: Number | None
    used: bool
    strides: Number | None


class _Climb(Struct, frozen=True):
    stride_m: Number | None = None
    angle_deg: Number | None = None
    total_m: Number | None = None
    certain: bool = False


class _Reliability(Struct, frozen=True):
    pelvis: bool = True
    torso: bool = True
    feet: bool = False
    trunk_lean_deg: Number | None = None
    pelvis_pitch_deg: Number | None = None
    planted_foot_pitch_deg: Number | None = None


class _Ranges(Struct):
    """Least and largest flexion in degrees."""

    knee_left: Interval
    knee_right: Interval
    hip_left: Interval
    hip_right: Interval


class _Measures(Struct, frozen=True):
    """Of a motion; the gate has limits for some."""

    penetration_m: Number | None = None
    floating_m: Number | None = None
    beyond_limits_deg: dict[str, Number] = {}


class _Ground(Struct, frozen=True):
    penetration_m: Number | None = None
    floating_m: Number | None = None
    swing_clearance_m: Number | None = None
    slip_m_s: Number | None = None


class Gait(Struct):
    """gait.json; a motion as recorded lacks the fields of a loop, earlier versions lack some of either."""

    kind: Literal["walk", "run", "motion"]
    cyclic: bool
    warnings: list[str]
    range_deg: _Ranges
    gate: list[_Finding] = []
    motion: str | None = None
    simulated_capture: bool = False
    reliability: _Reliability = _Reliability()
    r2_loop_against_capture: dict[str, Number | None] = {}
    bouts: list[_Bout] = []
    stance_ratio: _PerSide = {}
    path: _Path | None = None
    climb: _Climb | None = None
    period_s: Number | None = None
    cadence_steps_per_min: Number | None = None
    speed_m_s: Number | None = None
    speed_capture_m_s: Number | None = None
    speed_scaled_m_s: Number | None = None
    stride_m: Number | None = None
    strides_used: Number | None = None
    strides_found: Number | None = None
    strides_left_out: str = ""
    frames_used: Count | None = None
    symmetric: bool = False
    asymmetry_deg: Number | None = None
    noise_deg: Number | None = None
    asymmetry_limit_deg: Number | None = None
    duration_s: Number | None = None
    turn_deg: Number | None = None
    scale: Number | None = None
    subject: dict[str, Number | None] = {}
    measures: _Measures = _Measures()
    closed_form: dict[str, Number | dict[str, Number | None] | None] = {}
    ground: _Ground = _Ground()
