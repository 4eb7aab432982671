"""A run folder as a Python object: its stages are methods, its results properties."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from kinemimic.evaluate.policies.scores_file import read_scores
from kinemimic.evaluate.workflow.run import RUN_STAGES
from kinemimic.evaluate.workflow.run import run as run_stages
from kinemimic.pipeline.convert import convert, read_converted
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_clip
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.video.options import VideoOptions
from kinemimic.pipeline.run_folder.capture import default_run
from kinemimic.pipeline.run_folder.record import read_run_record
from kinemimic.retarget.command import retarget
from kinemimic.retarget.feet.ankles import AnkleMode
from kinemimic.retarget.formats.gait_json import read_gait_json
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.scenario.scenario import Scenario


class Run:
    """A run folder, as the commands use it. folder: its path; it need not exist yet.

    Each stage's method reads the results of the stages before it and writes its own into the folder, as the
    command of the same name does. Methods and properties raise KinemimicError for input that the user can
    correct. If a stage's input is missing or was made from another capture, the message names the stage to
    run.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r}): {self._summary()}"

    def _summary(self) -> str:
        """The latest result, in words."""
        entry = read_run_record(self.folder).stages.get("ingest")
        capture = "no capture yet" if entry is None else next(iter(entry.sources), "a capture")
        try:
            if self._has("scores.json"):
                from kinemimic.evaluate.scoring.metrics.verdict import verdict  # noqa: PLC0415 (import cost)

                return f"{capture}, {verdict(self.scores).headline}"
            if self._has("motion.json"):
                return f"{capture}, {self.motion!r}, no scores yet"
        except KinemimicError as error:
            return f"{capture}, results that cannot be read: {error}"
        return f"{capture}, no motion yet"

    def _has(self, file: str) -> bool:
        return (self.folder / file).is_file()

    def ingest(
        self,
        capture: str | Path,
        *,
        filter_name: str | None = None,
        unit: str | None = None,
        rate: float | None = None,
        video: VideoOptions | None = None,
        overwrite: bool = False,
    ) -> Clip:
        """Read, check and clean a capture (`pipeline/ingest.py`); returns the clean clip.

        filter_name: "kalman" (default), "butterworth", "one-euro" or "none"; unit: length unit of the file,
        as for --unit; rate: its true frame rate, Hz; video: options of a video. By default, unit and rate are
        those of the file. overwrite: set the results of another capture in the folder aside.
        """
        return ingest(
            Path(capture), self.folder, filter_name=filter_name, unit=unit, rate=rate, video=video,
            overwrite=overwrite,
        )  # fmt: skip

    def convert(self) -> Clip:
        """Convert to quaternions and check for gimbal lock (`pipeline/convert.py`); returns the clip."""
        return convert(self.folder)

    def retarget(
        self,
        *,
        symmetric: bool | None = None,
        refined: bool = True,
        ankle: AnkleMode = "neutral",
        loop: bool | None = None,
        straighten: bool | None = None,
        segment: str | None = None,
        balance: bool = False,
    ) -> Motion:
        """Retarget to the humanoid; returns the reference motion. Arguments: see `retarget/command.py`."""
        return retarget(
            self.folder,
            symmetric=symmetric,
            refined=refined,
            ankle=ankle,
            loop=loop,
            straighten=straighten,
            segment=segment,
            balance=balance,
        )

    def train(
        self,
        *,
        preset_name: str = "default",
        budget: int | None = None,
        minutes: float | None = None,
        seed: int = 0,
        workers: int | None = None,
        engine: str = "auto",
        resume: bool = True,
        anyway: bool = False,
        scenario: Scenario | None = None,
        start: str | None = None,
        teachers: Path | None = None,
        config: TrainConfig | None = None,
        ray: str | None = None,
        device: str = "cpu",
    ) -> dict[str, Any]:
        """Train a policy on the motion; returns the policy's record. Arguments: see `train/command.py`.

        Worker processes import your script: call this method under `if __name__ == "__main__":`.
        """
        from kinemimic.train.command import train  # noqa: PLC0415 (imports torch)

        return train(
            self.folder,
            preset_name=preset_name,
            budget=budget,
            minutes=minutes,
            seed=seed,
            workers=workers,
            engine=engine,
            resume=resume,
            anyway=anyway,
            scenario=scenario,
            start=start,
            teachers=teachers,
            config=config,
            ray=ray,
            device=device,
        )

    def evaluate(self, *, workers: int | None = None, engine: str = "auto") -> dict[str, Any]:
        """Score the policy and write the report (`evaluate/scoring/evaluate.py`); returns the scores.

        workers: simulation processes, by default one per core; engine: "auto", "native" or "pybullet".
        """
        from kinemimic.evaluate.scoring.evaluate import evaluate  # noqa: PLC0415 (import cost)

        return evaluate(self.folder, workers=workers, engine=engine)

    def gait(self) -> dict[str, Any]:
        """Compare gait parameters of capture, reference and simulation with norms; returns the report."""
        from kinemimic.evaluate.scoring.gait_command import gait  # noqa: PLC0415 (import cost)

        return gait(self.folder)

    def view(self) -> Path:
        """Write view.rrd, the recording for rerun; returns its path."""
        from kinemimic.evaluate.view.command import view  # noqa: PLC0415 (import cost)

        return view(self.folder)

    def export(self, formats: Sequence[str] = ("all",), *, what: Sequence[str] = ()) -> list[Path]:
        """Write files for other programs into the folder's `export/`; returns their paths.

        formats: of `kinemimic export --format`; what: "capture", "reference", "simulated" or "both", by
        default every motion that the folder has.
        """
        from kinemimic.evaluate.export.command import export_run  # noqa: PLC0415 (import cost)

        return [one.path for one in export_run(self.folder, what=what, formats=formats)]

    @property
    def raw(self) -> Clip:
        """The capture as recorded, after repairs."""
        return read_clip(self.folder / "raw.parquet")

    @property
    def clip(self) -> Clip:
        """The clean capture, with rotations once it is converted."""
        if self._has("quaternions.parquet"):
            return read_converted(self.folder)
        return read_clip(self.folder / "clip.parquet")

    @property
    def motion(self) -> Motion:
        """The reference motion on the humanoid."""
        return read_motion_json(self.folder / "motion.json")

    @property
    def retarget_report(self) -> Mapping[str, Any]:
        """What `retarget` measured (gait.json); `gait` returns the gait report."""
        return read_gait_json(self.folder / "gait.json")

    @property
    def scores(self) -> dict[str, Any]:
        """The scores that `evaluate` wrote (scores.json)."""
        return read_scores(self.folder / "scores.json")


def run(
    capture: str | Path | None = None,
    folder: str | Path | None = None,
    *,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    stages: Sequence[str] = RUN_STAGES,
    policy: str | None = None,
    from_scratch: bool = False,
    overwrite: bool = False,
    quiet: bool = True,
) -> Run:
    """Run all stages on a capture, skipping those that are up to date, as `kinemimic run` does.

    capture: a file or folder; None records the stock walk with the virtual Kinect. folder: the run folder,
    by default runs/NAME, named after the capture. options, stages, policy, from_scratch, overwrite: as in
    `evaluate/workflow/run.py`, for example options={"train": {"budget": "300k", "seed": 1}}, or
    policy="tracker". quiet: print nothing. KinemimicError for input that the user can correct.
    """
    source = None if capture is None else Path(capture)
    place = default_run(source) if folder is None else Path(folder)
    run_stages(
        source,
        place,
        options=options,
        stages=stages,
        policy=policy,
        from_scratch=from_scratch,
        overwrite=overwrite,
        quiet=quiet,
    )
    return Run(place)
