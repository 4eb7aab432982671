"""What a person asks of the page and its loop, beside the inputs of the session."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TogglePause:
    """Pause, or go on."""


@dataclass(frozen=True)
class StepOnce:
    """Do one control step, and pause."""


@dataclass(frozen=True)
class SetSpeed:
    """Run at a share of real time."""

    share: float


@dataclass(frozen=True)
class Choose:
    """Go on with a policy and a motion, by their names; speed: factor on the motion's speed."""

    policy: str
    motion: str
    speed: float


@dataclass(frozen=True)
class ToggleRecording:
    """Begin a recording, or end it."""


@dataclass(frozen=True)
class Redraw:
    """Draw again: what is shown has changed."""


Request = TogglePause | StepOnce | SetSpeed | Choose | ToggleRecording | Redraw
