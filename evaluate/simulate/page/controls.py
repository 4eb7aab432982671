"""The page's panel: buttons and sliders that send inputs, and the numbers and curves of the session."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import viser
from viser import uplot

from kinemimic.evaluate.simulate.page.requests import (
    Choose,
    Redraw,
    Request,
    SetSpeed,
    StepOnce,
    TogglePause,
    ToggleRecording,
)
from kinemimic.evaluate.simulate.session.frame import Frame, Status
from kinemimic.evaluate.simulate.session.inputs import (
    Carry,
    Clear,
    Enter,
    Ground,
    Input,
    Push,
    Restart,
    Throw,
)
from kinemimic.train.sim.world import CONTROL_RATE

Event = viser.GuiEvent[Any]
T = TypeVar("T", bound=Any)
NO_SCENARIO = "none"
SHOWN = 4 * CONTROL_RATE  # control steps of the curves
CURVES = {"knee": "knee_left", "hip": "hip_left"}


@dataclass(frozen=True)
class Choices:
    """What the page offers, by name; there are no controls for what cannot be chosen.

    policy, motion: what is performed first; trackers: the policies that perform every motion (any other
    performs only its own, of the same name); phases: whether the motion can begin at any phase; slower:
    whether time can be slowed, unlike that of a live capture.
    """

    policies: Sequence[str]
    motions: Sequence[str]
    scenarios: Sequence[str]
    policy: str
    motion: str
    trackers: Sequence[str] = ()
    phases: bool = True
    slower: bool = True

    @property
    def others(self) -> bool:
        """Whether another policy, motion or speed of the motion can be chosen."""
        return len(self.policies) > 1 or len(self.motions) > 1 or self.policy in self.trackers


@dataclass(frozen=True)
class Actions:
    """What the panel calls; client: number of the browser.

    allowed: whether a client holds the controls; if not, it is told so; send: an input or a request;
    take_control: give a client the controls; say: show a client a message.
    """

    allowed: Callable[[int], bool]
    send: Callable[[Input | Request], None]
    take_control: Callable[[int], None]
    say: Callable[[int, str], None]


class Controls:
    """The panel of a server.

    All callbacks are coroutines that wait for nothing: viser awaits these in the order of its messages, and
    runs plain functions in threads, in any order.
    """

    def __init__(self, server: viser.ViserServer, choices: Choices, actions: Actions) -> None:
        self._server, self._act = server, actions
        gui = server.gui
        gui.configure_theme(control_width="medium", dark_mode=False, show_share_button=False)
        gui.main_panel.dock_right()
        # Orders below 0 are above everything else.
        self.status = gui.add_markdown("", order=-3.0)
        self._control = gui.add_button("Take control", icon=viser.Icon.HAND_GRAB, order=-1.0)

        async def take(event: Event) -> None:
            if event.client_id is not None:
                actions.take_control(event.client_id)

        self._control.on_click(take)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Play"):
            self._play(choices)
        with tabs.add_tab("Push"):
            self._push()
        with tabs.add_tab("Ground"):
            self._ground(choices)
        with tabs.add_tab("Curves"):
            self._curves()

    @staticmethod
    def note(client: viser.ClientHandle) -> Any:
        """A line for one viewer alone, below the state of the session."""
        return client.gui.add_markdown("", order=-2.0)

    def _clicks(self, button: Any, clicked: Callable[[Event], None]) -> Any:
        """Call a function when a viewer who holds the controls presses a button."""

        async def called(event: Event) -> None:
            if event.client_id is not None and self._act.allowed(event.client_id):
                clicked(event)

        button.on_click(called)
        return button

    def _button(self, label: str, make: Callable[[], Input | Request], hint: str | None = None) -> None:
        self._clicks(self._server.gui.add_button(label, hint=hint), lambda _: self._act.send(make()))

    def _held(self, handle: T, make: Callable[[], Input | Request] | None = None) -> T:
        """An input whose value only the holder of the controls changes; make: what to send then.

        viser has stored and sent on the value before it asks.
        """
        value = handle.value

        async def changed(event: Event) -> None:
            nonlocal value
            if event.client_id is None:  # from here
                value = handle.value
            elif not self._act.allowed(event.client_id):
                handle.value = value
            else:
                value = handle.value
                if make is not None:
                    self._act.send(make())

        handle.on_update(changed)
        return handle

    def _play(self, choices: Choices) -> None:
        gui, act = self._server.gui, self._act
        self._pause = self._clicks(
            gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE), lambda _: act.send(TogglePause())
        )
        self._clicks(
            gui.add_button("Step", icon=viser.Icon.PLAYER_TRACK_NEXT), lambda _: act.send(StepOnce())
        )
        if choices.slower:
            speed = gui.add_slider("Playback speed", 0.1, 1.0, 0.05, 1.0, hint="1 is real time")
            self._held(speed, lambda: SetSpeed(float(speed.value)))
        phase = self._held(gui.add_slider("Start phase", 0.0, 1.0, 0.01, 0.0)) if choices.phases else None
        self._button(
            "Restart",
            lambda: Restart(0.0 if phase is None else float(phase.value)),
            "Put the humanoid onto its reference",
        )
        self.follow = self._held(gui.add_checkbox("Camera follows", initial_value=True), Redraw)
        self.ghost = self._held(gui.add_checkbox("Show reference", initial_value=True), Redraw)
        if choices.others:
            self._choose(choices)
        self._recorder = self._clicks(
            gui.add_button("Record", icon=viser.Icon.PLAYER_RECORD, color="red"),
            lambda _: act.send(ToggleRecording()),
        )

    def _choose(self, choices: Choices) -> None:
        gui, act = self._server.gui, self._act
        chosen = self._held(gui.add_dropdown("Policy", tuple(choices.policies), initial_value=choices.policy))
        performed: Any = self._held(
            gui.add_dropdown("Motion", tuple(choices.motions), initial_value=choices.motion,
                             hint="Only a tracker performs every motion")
        )  # fmt: skip
        pace = self._held(gui.add_slider("Speed of the motion", 0.7, 1.3, 0.05, 1.0, hint="For trackers"))

        def choose(event: Event) -> None:
            policy, motion = str(chosen.value), str(performed.value)
            own = policy in choices.motions and policy not in choices.trackers
            if own and motion != policy and event.client_id is not None:
                self._act.say(event.client_id, f"{policy} performs only its own motion")
                performed.value = motion = policy
            act.send(Choose(policy, motion, float(pace.value)))

        self._clicks(gui.add_button("Change policy and motion"), choose)

    def _push(self) -> None:
        gui = self._server.gui
        gui.add_markdown("Drag any body of the humanoid with the mouse.")
        self.stiffness = self._held(gui.add_slider("Spring stiffness, N/m", 50, 2000, 50, 200))
        self.limit = self._held(gui.add_slider("Largest force, N", 10, 1000, 10, 150))
        with gui.add_folder("Pull and push the torso"):
            self._push_torso()
        with gui.add_folder("Leg force and arm torque"):
            self._load_limbs()
        with gui.add_folder("Balls and boxes"):
            self._throw()

    def _push_torso(self) -> None:
        """Forces on the torso, along and across the heading."""
        gui = self._server.gui
        size = self._held(gui.add_slider("Force, N", 5, 500, 5, 25))
        lasts = self._held(gui.add_slider("Time, s", 0.1, 3.0, 0.1, 1.0))
        growing = self._held(gui.add_checkbox("Increase gradually", initial_value=True))

        def pull(x: float, y: float) -> Callable[[], Input]:
            return lambda: Push(
                "torso",
                force=(x * float(size.value), y * float(size.value), 0.0),
                steps=max(1, round(float(lasts.value) * CONTROL_RATE)),
                growing=bool(growing.value),
            )

        for label, x, y in (("Forward", 1, 0), ("Backward", -1, 0), ("Left", 0, 1), ("Right", 0, -1)):
            self._button(label, pull(x, y))

    def _load_limbs(self) -> None:
        """A force, a torque and a weight on single limbs."""
        gui = self._server.gui
        seconds = self._held(gui.add_slider("Duration, s", 0.1, 7.0, 0.1, 7.0))

        def steps() -> int:
            return max(1, round(float(seconds.value) * CONTROL_RATE))

        self._button("100 N on a thigh", lambda: Push("thigh_left", force=(100.0, 0.0, 0.0), steps=steps()))
        self._button(
            "30 N·m on an arm", lambda: Push("upper_arm_left", torque=(30.0, 0.0, 0.0), steps=steps())
        )
        weight = gui.add_slider("Weight in the hand, kg", 0.0, 10.0, 0.5, 0.0)
        self._held(weight, lambda: Carry("hand_left", float(weight.value)))

    def _throw(self) -> None:
        """Obstacles, thrown or placed ahead."""
        gui = self._server.gui
        mass = self._held(gui.add_slider("Mass, kg", 0.5, 20.0, 0.5, 1.0))
        self._button(
            "Throw a ball at the chest",
            lambda: Throw("sphere", (0.24,) * 3, float(mass.value), (1.8, 0.0, 1.15), (-2.0, 0.0, 2.6)),
        )
        self._button(
            "Throw a ball from the side",
            lambda: Throw("sphere", (0.24,) * 3, float(mass.value), (0.0, 1.8, 1.15), (0.0, -2.0, 2.6)),
        )
        self._button(
            "Box of knee height ahead",
            lambda: Throw("box", (0.3, 0.3, 0.45), float(mass.value), (1.5, 0.0, 0.225)),
        )
        self._button(
            "Post of hip height ahead",
            lambda: Throw("cylinder", (0.3, 0.3, 0.85), float(mass.value), (1.5, 0.0, 0.425)),
        )
        self._button("Remove obstacles and pushes", Clear)

    def _ground(self, choices: Choices) -> None:
        gui = self._server.gui
        friction = self._held(gui.add_slider("Friction", 0.05, 1.0, 0.05, 0.9))
        slope = self._held(gui.add_slider("Slope, degrees", -10.0, 10.0, 0.5, 0.0))
        self._button("Apply", lambda: Ground(float(friction.value), float(np.radians(slope.value))))
        if not choices.scenarios:
            return
        scenario = self._held(gui.add_dropdown("Scenario", (NO_SCENARIO, *choices.scenarios)))
        trial = self._held(gui.add_number("Trial", 0, min=0, max=9999, step=1))
        self._button(
            "Start the scenario",
            lambda: Enter("" if scenario.value == NO_SCENARIO else str(scenario.value), int(trial.value)),
        )

    def _curves(self) -> None:
        gui = self._server.gui
        self._numbers = gui.add_markdown("")
        self._rows: deque[tuple[float, ...]] = deque(maxlen=SHOWN)
        empty = tuple(np.zeros(2) for _ in range(3))
        self._plots = {
            name: gui.add_uplot(
                empty,
                (
                    uplot.Series(label="s"),
                    uplot.Series(label="reference", stroke="#3b82f6", width=2),
                    uplot.Series(label="simulated", stroke="#f97316", width=2),
                ),
                title=f"{name} of the left leg, degrees",
                scales={"x": uplot.Scale(time=False)},
                aspect=2.0,
            )
            for name in CURVES
        }

    def take(self, frame: Frame) -> None:
        """Keep a frame for the curves."""
        time = frame.step / CONTROL_RATE
        if self._rows and time < self._rows[-1][0]:  # another session
            self._rows.clear()
        if self._rows and time == self._rows[-1][0]:  # drawn again while the session is paused
            self._rows.pop()
        row = [time]
        for angle in CURVES.values():
            row += [np.degrees(frame.wanted[angle]), np.degrees(frame.angles[angle])]
        self._rows.append(tuple(row))

    def show(self, frame: Frame, status: Status) -> None:
        """Numbers and curves; a few times a second."""
        self.status.content = status.text
        _label(self._pause, "Resume" if status.paused else "Pause")
        _label(self._recorder, "Stop recording" if status.recording else "Record")
        rows = np.array(self._rows)
        if len(rows) > 1:
            for k, plot in enumerate(self._plots.values()):
                plot.data = (rows[:, 0], rows[:, 1 + 2 * k], rows[:, 2 + 2 * k])
        terms = "".join(f"| {name} | {value:.2f} |\n" for name, value in frame.terms.items())
        height = frame.bodies.positions[0, 2]
        self._numbers.content = f"| reward | |\n|---|---|\n{terms}| height of the pelvis | {height:.2f} m |"


def _label(button: Any, label: str) -> None:
    if button.label != label:  # viser sends every assignment
        button.label = label
