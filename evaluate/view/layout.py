"""Layout of the recording: humanoids on the left, curves and scores on the right."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from kinemimic.evaluate.view.scene import TIMELINE
from kinemimic.pipeline.kinematics.angles import ANGLES

PLOTTED = (-3.0, 1.0)  # s around the cursor: two or three strides are legible, twenty are not


def layout(*, capture: bool = False) -> rrb.Blueprint:
    """The blueprint of view.rrd; capture: whether the captured skeleton is shown."""
    humanoids = "Simulated (orange), reference (blue)" + (", capture (white)" if capture else "")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                _scene("overlaid", humanoids, eye=(1.0, -1.9, 1.1)),
                _scene("beside", "Side by side", eye=(0.0, -2.3, 1.0)),
                row_shares=[3, 2],
            ),
            rrb.Vertical(
                rrb.Grid(*(_angle(angle) for angle in ANGLES), grid_columns=2),
                rrb.Tabs(
                    rrb.TextDocumentView(origin="scores", name="Scores"),
                    rrb.TimeSeriesView(origin="reward", name="Reward terms"),
                    rrb.TimeSeriesView(origin="torque", name="Peak torque, N·m"),
                    rrb.TimeSeriesView(origin="ground", name="Ground reaction, N"),
                ),
                row_shares=[3, 2],
            ),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="playing", loop_mode="all"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def gallery_layout(scenes: Sequence[str], columns: int) -> rrb.Blueprint:
    """The blueprint of several scenes side by side."""
    views = (_scene(name, name, eye=(1.0, -1.9, 1.1)) for name in scenes)
    return rrb.Blueprint(
        rrb.Grid(*views, grid_columns=columns),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="playing", loop_mode="all"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def _scene(origin: str, name: str, eye: tuple[float, float, float]) -> rrb.Spatial3DView:
    """A tracking view: its origin follows the simulated humanoid, so that a fixed eye keeps it in view."""
    return rrb.Spatial3DView(
        origin=f"{origin}/walker",
        contents=f"/{origin}/**",
        name=name,
        line_grid=False,
        background=(20, 22, 26),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=eye, look_target=(0.0, 0.0, 0.85), eye_up=(0.0, 0.0, 1.0)
        ),
    )


def _angle(angle: str) -> rrb.TimeSeriesView:
    joint, side = angle.split("_")
    start, end = (rrb.TimeRangeBoundary.cursor_relative(seconds=seconds) for seconds in PLOTTED)
    return rrb.TimeSeriesView(
        origin=f"angles/{angle}",
        name=f"{joint.capitalize()} flexion, {side}, degrees",
        axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(start=start, end=end)),
        plot_legend=rrb.PlotLegend(visible=False),
    )
