"""The page's panel: buttons and sliders that send inputs, and the numbers and curves of the session."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from viser import uplot

from kinemimic.evaluate.simulate.frame import Frame
from kinemimic.evaluate.simulate.inputs import Carry, Clear, Enter, Ground, Input, Push, Restart, Throw
from kinemimic.train.sim.world import CONTROL_RATE

Send = Callable[[viser.GuiEvent[Any], Input], None]
Act = Callable[[viser.GuiEvent[Any]], None]
NO_SCENARIO = "none"
SHOWN = 4 * CONTROL_RATE  # control steps of the curves
CURVES = {"knee": "knee_left", "hip": "hip_left"}


@dataclass(frozen=True)
class Choices:
    """What the page offers, by name; policy, motion: what is performed first."""

    policies: Sequence[str]
    motions: Sequence[str]
    scenarios: Sequence[str]
    policy: str
    motion: str


@dataclass(frozen=True)
class Actions:
    """What the page asks of its owner beside inputs; every callback gets the event of the click."""

    send: Send
    toggle: Act
    one_step: Act
    slower: Callable[[viser.GuiEvent[Any], float], None]
    choose: Callable[[viser.GuiEvent[Any], str, str, float], None]
    record: Act
    take_control: Act


class Controls:
    """The panel of a server."""

    def __init__(self, server: viser.ViserServer, choices: Choices, actions: Actions) -> None:
        self._server, self._act = server, actions
        gui = server.gui
        gui.configure_theme(control_width="medium", dark_mode=False, show_share_button=False)
        gui.main_panel.dock_right()
        self.status = gui.add_markdown("")
        self._control = gui.add_button("Take control", icon=viser.Icon.HAND_GRAB)
        self._control.on_click(actions.take_control)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Play"):
            self._play(choices)
        with tabs.add_tab("Push"):
            self._push()
        with tabs.add_tab("Ground"):
            self._ground(choices)
        with tabs.add_tab("Curves"):
            self._curves()

    def _button(self, label: str, make: Callable[[], Input], hint: str | None = None) -> None:
        def clicked(event: viser.GuiEvent[Any]) -> None:
            self._act.send(event, make())

        self._server.gui.add_button(label, hint=hint).on_click(clicked)

    def _play(self, choices: Choices) -> None:
        gui, act = self._server.gui, self._act
        self.pause = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE)
        self.pause.on_click(act.toggle)
        gui.add_button("One step", icon=viser.Icon.PLAYER_TRACK_NEXT).on_click(act.one_step)
        speed = gui.add_slider("Slow motion", 0.1, 1.0, 0.05, 1.0, hint="1 is real time")
        speed.on_update(lambda event: act.slower(event, float(speed.value)))
        phase = gui.add_slider("Start phase", 0.0, 1.0, 0.01, 0.0)
        self._button("Restart", lambda: Restart(float(phase.value)), "Put the humanoid onto its reference")
        self.follow = gui.add_checkbox("Follow", initial_value=True)
        self.ghost = gui.add_checkbox("Show reference", initial_value=True)
        policy = gui.add_dropdown("Policy", tuple(choices.policies), initial_value=choices.policy)
        motion = gui.add_dropdown("Motion", tuple(choices.motions), initial_value=choices.motion,
                                  hint="Only a tracker performs every motion")  # fmt: skip
        pace = gui.add_slider("Speed of the motion", 0.7, 1.3, 0.05, 1.0, hint="For trackers")
        gui.add_button("Change policy and motion").on_click(
            lambda event: act.choose(event, str(policy.value), str(motion.value), float(pace.value))
        )
        self.recorder = gui.add_button("Record", icon=viser.Icon.PLAYER_RECORD, color="red")
        self.recorder.on_click(act.record)

    def _push(self) -> None:
        gui = self._server.gui
        gui.add_markdown("Drag any body of the humanoid with the mouse.")
        self.stiffness = gui.add_slider("Spring, N/m", 50, 2000, 50, 200)
        self.limit = gui.add_slider("Limit, N", 10, 1000, 10, 150)
        with gui.add_folder("Pull and push the torso (Fig. 9)"):
            size = gui.add_slider("Force, N", 5, 500, 5, 25)
            lasts = gui.add_slider("Time, s", 0.1, 3.0, 0.1, 1.0)
            growing = gui.add_checkbox("Growing", initial_value=True)

            def pull(x: float, y: float) -> Callable[[], Input]:
                return lambda: Push(
                    "torso",
                    force=(x * float(size.value), y * float(size.value), 0.0),
                    steps=max(1, round(float(lasts.value) * CONTROL_RATE)),
                    growing=bool(growing.value),
                )

            for label, x, y in (("Forward", 1, 0), ("Backward", -1, 0), ("Left", 0, 1), ("Right", 0, -1)):
                self._button(label, pull(x, y))
        with gui.add_folder("Leg force and arm torque (Fig. 10)"):
            seconds = gui.add_slider("Time of both, s", 0.1, 7.0, 0.1, 7.0)

            def steps() -> int:
                return max(1, round(float(seconds.value) * CONTROL_RATE))

            self._button(
                "100 N on a thigh", lambda: Push("thigh_left", force=(100.0, 0.0, 0.0), steps=steps())
            )
            self._button(
                "30 N·m on an arm", lambda: Push("upper_arm_left", torque=(30.0, 0.0, 0.0), steps=steps())
            )
            weight = gui.add_slider("Weight in the hand, kg", 0.0, 10.0, 0.5, 0.0)
            weight.on_update(lambda event: self._act.send(event, Carry("hand_left", float(weight.value))))
        with gui.add_folder("Balls and boxes (Fig. 11)"):
            mass = gui.add_slider("Mass, kg", 0.5, 20.0, 0.5, 1.0)
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
            self._button("Clear", Clear, "Remove all obstacles, and end all pushes")

    def _ground(self, choices: Choices) -> None:
        gui = self._server.gui
        friction = gui.add_slider("Friction", 0.05, 1.0, 0.05, 0.9)
        slope = gui.add_slider("Slope, degrees", -10.0, 10.0, 0.5, 0.0)
        self._button(
            "Change the ground", lambda: Ground(float(friction.value), float(np.radians(slope.value)))
        )
        scenario = gui.add_dropdown("Scenario", (NO_SCENARIO, *choices.scenarios))
        seed = gui.add_number("Trial", 0, min=0, max=9999, step=1)
        self._button(
            "Enter the scenario",
            lambda: Enter("" if scenario.value == NO_SCENARIO else str(scenario.value), int(seed.value)),
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
        row = [frame.step / CONTROL_RATE]
        for angle in CURVES.values():
            row += [np.degrees(frame.wanted[angle]), np.degrees(frame.angles[angle])]
        self._rows.append(tuple(row))

    def show(self, frame: Frame, state: str) -> None:
        """Numbers and curves; a few times a second."""
        self.status.content = state
        rows = np.array(self._rows)
        if len(rows) > 1:
            for k, plot in enumerate(self._plots.values()):
                plot.data = (rows[:, 0], rows[:, 1 + 2 * k], rows[:, 2 + 2 * k])
        terms = "".join(f"| {name} | {value:.2f} |\n" for name, value in frame.terms.items())
        height = frame.bodies.positions[0, 2]
        self._numbers.content = f"| reward | |\n|---|---|\n{terms}| height of the pelvis | {height:.2f} m |"
