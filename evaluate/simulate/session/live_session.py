"""A session that a live capture drives: frames are its inputs, beside what people do on the page."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np

from kinemimic.evaluate.simulate.session.frame import Frame, LiveSettings, LiveView
from kinemimic.evaluate.simulate.session.inputs import Enter, Input, Restart
from kinemimic.evaluate.simulate.session.session import Session, policy_actions
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.live.capture import FORGET, LiveCapture
from kinemimic.pipeline.live.frame import CapturedFrame
from kinemimic.pipeline.plural import plural
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.live.performer import Performer
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.prediction.live_prediction import LivePrediction
from kinemimic.train.prediction.predictor import Predictor
from kinemimic.train.reference.live_reference import KNOWN, LiveReference
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.balance import balance_turns
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS
from kinemimic.train.task.mirror import Mirror, left_foot_behind

FADE = 0.2  # of the share of what is done on the spot, per control step


class LiveSession(Session):
    """One humanoid that follows a live capture.

    The humanoid follows the person with the lag of the filter; the poses to which the tracker looks ahead are
    predicted. standing: policy for a person who stays on the spot, where ankles and hips balance the
    humanoid; without one, they do so alone. A tracker that balances (`EnvConfig.balance`) performs everything
    itself. restarts: number of restarts that were requested on the page.
    """

    def __init__(
        self,
        policy: Policy,
        config: EnvConfig,
        engine: str,
        settings: LiveSettings,
        predictor: Predictor,
        standing: Policy | None = None,
        *,
        restart: bool = True,
        scenario_named: Callable[[str], Scenario] | None = None,
    ) -> None:
        self.live = settings
        self.capture = LiveCapture(step=1.0 / CONTROL_RATE, lag=settings.lag, up=settings.up)
        self.performer = Performer(float(CONTROL_RATE))
        first = self.performer.perform(None)
        self.restarts = 0
        self._mirror = Mirror(config)
        self._place_there, self._denoise = settings.place, settings.denoise
        self._live = LiveReference(first.root, first.rotations, LivePrediction(predictor))
        self._standing = standing
        self._on_the_spot = 1.0  # share of what is done on the spot
        self._placed_in: int | None = None
        self._shown: LiveView | None = None
        held = Motion(
            CONTROL_RATE, np.tile(first.root, (2, 1)), np.tile(first.rotations, (2, 1, 1)),
            np.zeros((2, 2), dtype=np.bool_), cyclic=False,
        )  # fmt: skip
        super().__init__(held, policy, config, engine, restart=restart, scenario_named=scenario_named)

    def _reference(self, scenario: Scenario | None) -> Reference:
        return self._live

    def _restart_phase(self) -> float:
        return self._live.present

    def _is_over(self) -> bool:
        return False

    def _reset(self, phase: float) -> None:
        # The next control step begins one frame later than the last: `advance` appends that frame first.
        super()._reset(self._live.present + 1.0 / CONTROL_RATE)

    def apply(self, found: Input | CapturedFrame) -> None:
        """Take a frame, or an input of a page; KinemimicError for an input that does not fit. A frame that
        does not fit its sender's others is counted, and `capture` says why."""
        if isinstance(found, CapturedFrame):
            with suppress(KinemimicError):
                self.capture.take(found)
            return
        self.restarts += isinstance(found, Restart)
        if isinstance(found, Enter) and found.scenario:
            raise KinemimicError("expected no scenario: a live capture has no phases at which it could begin")
        super().apply(found)

    def _advance_reference(self) -> None:
        moment = self.capture.advance()
        performed = self.performer.perform(moment)
        noise = performed.noise if self._denoise else 0.0
        self._on_the_spot += min(max(float(performed.on_the_spot) - self._on_the_spot, -FADE), FADE)
        self._live.append(performed.root, performed.rotations, noise, self._on_the_spot)
        if performed.appeared and self._place_there:
            # Control steps until the humanoid performs the person's first frames, after the fade.
            self._placed_in = KNOWN + CONTROL_RATE // 2
        if self._placed_in is not None:
            self._placed_in -= 1
            if self._placed_in <= 0:
                self._placed_in = None
                super()._reset(self._live.present)
        nowhere = np.full((20, 3), np.nan)
        self._shown = LiveView(
            raw=nowhere if moment is None else moment.raw,
            clean=nowhere if moment is None else moment.positions[moment.now],
            time=float("nan") if moment is None else moment.time,
            presence=performed.presence,
            latency=float("nan") if moment is None else moment.lag,
            people=self.performer.people,
            starved=moment is None,
        )

    @property
    def shown(self) -> LiveView | None:
        """The capture at the end of the last control step."""
        return self._shown

    def _actions(self) -> Array:
        """The policy's, or those for a person on the spot."""
        batch, share = self._batch, self._on_the_spot
        actions = super()._actions()
        if share <= 0.0 or batch.config.balance:
            return actions
        balance = balance_turns(batch.bodies, batch.target).reshape(-1, ACTIONS) / ACTION_SCALE
        if batch.config.mirror:
            # The batch reflects the actions of a tracker back.
            self._mirror.actions(balance, left_foot_behind(batch.target))
        still = policy_actions(self._standing, self._observation) + balance
        return (1.0 - share) * actions + share * still

    def advance(self) -> Frame:
        """One control step, with the frames that have arrived since the last one."""
        self._advance_reference()
        self._batch.phases[:] = self._live.present
        return replace(super().advance(), shown=self._shown)

    def words(self) -> list[str]:
        """The state of the capture in lines."""
        capture = self.capture
        lines = [capture.complaint] if capture.complaint else []
        lines.append(self._doing())
        if (reading := capture.reading) is not None:
            counts = [
                f"{reading.layout.name}, {reading.up} up, in {reading.unit}",
                plural(capture.frames, "frame"),
                f"{capture.late} late",
                f"{capture.thinned} left out" if capture.thinned else "",
                f"{plural(capture.sides.swaps, 'frame')} with sides swapped back",
                f"appeared {plural(self.performer.people, 'time')}",
            ]
            lines.append(", ".join(filter(None, counts)))
        if capture.refused:
            lines.append(f"refused: {capture.refused} (last: {capture.last_fault})")
        return lines

    def _doing(self) -> str:
        """What the humanoid follows, and how far behind."""
        shown, quiet = self._shown, self.capture.quiet
        if shown is None or not self.capture.senders:
            return "waiting for frames"
        if quiet > FORGET:
            return f"**no frames for {quiet:.0f} s: standing**"
        if self.capture.reading is None:
            return "receiving frames: waiting for frames that show both legs and the trunk"
        doing = "following the person" if shown.presence >= 1.0 else "nobody in view: standing"
        if shown.presence >= 1.0 and self._on_the_spot >= 0.5:
            doing += " on the spot"
        if 0.0 < shown.presence < 1.0:
            doing = "changing between standing and following the person"
        if shown.starved:
            return f"**{doing}**"
        return f"**{doing}**, {1000.0 * shown.latency:.0f} ms behind"
