"""Recordings of the Unity assets: "kb" of a Kinect v2, "k4b" of an Azure Kinect with a second person."""

from __future__ import annotations

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.readers.kinect.azure_joints import AZURE_JOINTS
from kinemimic.pipeline.readers.kinect.unity_recording import UNITY_AZURE_JOINTS
from samples.azure_kinect import CAMERA, camera_axes
from samples.azure_kinect import joints as azure_joints
from samples.kimore import SENSOR
from samples.motion import in_sight, kinect_v2_joints, walk, y_up

PERSON, BYSTANDER = 72057594037931521, 72057594037931522
# Of the file's last four joints, the left hand's tips, one has no place in the frame and one is inferred.
LOST, INFERRED, FRAME = -4, -3, 10
# The sensor's first tick of 100 ns, and the time that the game spends on a frame, in seconds.
FIRST_TICK, GAME_STEP = 4233300000, 0.0166


def body(identity: int, places: Array, *, states: dict[int, int], angles: bool) -> list[str]:
    """The cells of a body; states: of the joints that are not 2, from the end."""
    cells = ["1", str(identity)]
    for joint, place in enumerate(places):
        state = states.get(joint - len(places), 2)
        cells.append(str(state))
        if state:
            cells += [f"{value:.3f}" for value in place] + ["12.500", "300.000", "0.250"] * angles
    return cells


def line(time: float, word: str, joints: int, extra: list[str], bodies: list[list[str]]) -> str:
    """A line; the game sees a frame at its own next step."""
    game = GAME_STEP * (1 + time // GAME_STEP)
    head = [word, str(FIRST_TICK + round(1e7 * time)), str(len(bodies)), str(joints), *extra]
    return f"{game:.3f}|" + ",".join(head + [cell for one in bodies for cell in one])


def files(frames: int = 90) -> dict[str, bytes]:
    """Both recordings of the same walk; places are written to the millimetre."""
    shown = in_sight(walk(frames))
    kinect = y_up(kinect_v2_joints(shown)) + SENSOR
    azure = camera_axes(azure_joints(shown) - CAMERA)
    azure = azure[:, [AZURE_JOINTS.index(joint) for joint in UNITY_AZURE_JOINTS]]
    v2_lines, azure_lines = [], []
    for frame, time in enumerate(shown.times):
        states = {LOST: 0, INFERRED: 1} if frame == FRAME else {}
        one = body(PERSON, kinect[frame], states=states, angles=False)
        v2_lines.append(line(time, "kb", 25, [], [["0"], one, *[["0"]] * 4]))
        people = [body(PERSON, azure[frame], states=states, angles=True)]
        if frame % 3 == 0:
            people.insert(0, body(BYSTANDER, azure[frame] + 1.0, states={}, angles=True))
        azure_lines.append(line(time, "k4b", 32, ["-1", "-1", "1"], people))
    return {
        "BodyRecording.txt": ("\r\n".join(v2_lines) + "\r\n").encode(),
        "AzureBodyRecording.txt": ("\r\n".join(azure_lines) + "\r\n").encode(),
    }
