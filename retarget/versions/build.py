"""`kinemimic datasets build`: runs the stages on one raw recording and stores canonical arrays."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import click
import numpy as np

from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.convert import convert, read_converted
from kinemimic.pipeline.files.canonical import Canonical
from kinemimic.pipeline.files.store import read_clip
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.retarget.command import retarget
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.versions.params import Capture, Params, params_option

# Stage -> file of its output.
STAGES = {"ingest": "clip.json", "convert": "quaternions.json", "retarget": "motion.json"}
LAST_STAGE = "retarget"


def canonical_motion(motion: Motion) -> Canonical:
    """Everything that a policy is trained on, and the foot contacts."""
    return Canonical.of(
        "motion",
        NODES,
        {
            "rate": np.array(motion.rate),
            "cyclic": np.array(motion.cyclic),
            "cycle_offset": motion.cycle_offset,
            "root": motion.root,
            "rotations": motion.rotations,
            "contacts": motion.contacts,
            "offsets": motion.offsets,
        },
        {"simulated": motion.simulated},
    )


def build_capture(capture: Capture, root: Path, through: str = LAST_STAGE) -> Mapping[str, Canonical]:
    """File name -> output of the stages up to `through` for a recording below `root`.

    Every stage works on the exact output of the previous one, not on its rounded copy.
    """
    with TemporaryDirectory(prefix="kinemimic-") as folder:
        run = Path(folder)
        ingest(root / capture.file, run, filter_name=capture.filter)
        made = {STAGES["ingest"]: Canonical.of_clip(read_clip(run / "clip.parquet"))}
        if through == "ingest":
            return made
        convert(run)
        made[STAGES["convert"]] = Canonical.of_clip(read_converted(run))
        if through == "convert":
            return made
        retarget(
            run,
            symmetric=capture.symmetric,
            refined=capture.refined,
            ankle=capture.ankle,
            loop=capture.loop,
        )
        made[STAGES["retarget"]] = canonical_motion(read_motion_json(run / "motion.json"))
        return made


def built_path(params: Params, root: Path, name: str, file: str) -> Path:
    """Path of an output, beside the parameters."""
    return root / params.path.parent / "built" / name / file


@click.command("build")
@click.argument("name")
@click.option("--through", type=click.Choice(list(STAGES)), default=LAST_STAGE, show_default=True,
              help="The last stage to run; its output is written.")  # fmt: skip
@params_option
@json_option("Print path and content hash as JSON.")
def command(name: str, through: str, path: Path, as_json: bool) -> None:
    """Build one of the data set's captures, NAME, and write a stage's output as canonical arrays.

    `dvc repro` calls this command. It works in the current folder.

    \b
      kinemimic datasets build kinect_walk --through convert
    """
    params = Params.load(path)
    made = build_capture(params.capture(name), Path(), through)
    target = built_path(params, Path(), name, STAGES[through])
    made[STAGES[through]].write(target)
    said = {"path": str(target), "content": made[STAGES[through]].identity}
    click.echo(json.dumps(said, indent=2) if as_json else said["path"])
