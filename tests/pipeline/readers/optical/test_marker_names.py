"""Labels of laboratories' marker sets, of subjects and of computed joint centres."""

from __future__ import annotations

import pytest

from kinemimic.pipeline.readers.optical.marker_names import joint_centres, landmarks, without_subject

PLUG_IN_GAIT = "LASI RASI LPSI RPSI LTHI LKNE LTIB LANK LTOE RTHI RKNE RTIB RANK RTOE"
ANATOMICAL = "CV7 SJN " + " ".join(
    f"{s}_IAS {s}_IPS {s}_FLE {s}_FME {s}_FAL {s}_TAM {s}_FCC {s}_FM1 {s}_FM2 {s}_FM5 {s}_SAE {s}_HLE "
    f"{s}_HME {s}_RSP {s}_USP"
    for s in "LR"
)
MOTIVE = "HeadTop BackTop Chest " + " ".join(
    f"Waist{s}Front Waist{s}Back {s}KneeOut {s}KneeIn {s}AnkleOut {s}AnkleIn {s}ToeOut {s}ToeIn "
    f"{s}ShoulderTop {s}ElbowOut {s}ElbowIn {s}WristOut {s}WristIn {s}HandOut"
    for s in "LR"
)
LEGS = ("asis", "psis", "knee_lateral", "ankle_lateral", "toes")
MEDIAL_AND_ARMS = ("knee_medial", "ankle_medial", "acromion", "elbow", "wrist")


@pytest.mark.parametrize("prefix", ["", "Jim:", "Subject1_", "Patient_01_", "Anna.", "Patient 7 "])
@pytest.mark.parametrize("names", [PLUG_IN_GAIT, ANATOMICAL, MOTIVE])
def test_a_subjects_name_does_not_matter(prefix: str, names: str) -> None:
    labels = names.split()
    known = landmarks([prefix + label for label in labels])
    assert known == landmarks(labels)
    wanted = LEGS if names is PLUG_IN_GAIT else (*LEGS, *MEDIAL_AND_ARMS)
    assert known.keys() >= {f"{landmark}_{side}" for landmark in wanted for side in ("left", "right")}


def test_which_marker_is_which() -> None:
    for names, lateral, medial, toes in (
        (ANATOMICAL, "R_FLE", "R_FME", ["R_FM2"]),
        (MOTIVE, "RKneeOut", "RKneeIn", ["RToeOut", "RToeIn"]),
    ):
        labels = names.split()
        found = landmarks(labels)
        assert [labels[k] for k in found["knee_lateral_right"]] == [lateral]
        assert [labels[k] for k in found["knee_medial_right"]] == [medial]
        assert [labels[k] for k in found["toes_right"]] == toes
    assert landmarks(ANATOMICAL.split())["neck_back"] == (0,)
    sports = ["Q_WaistLFront", "Q_WaistRFront", "Q_WaistBack", "Q_LKneeOut", "Q_RKneeOut"]
    assert {"asis_left", "asis_right", "sacrum", "knee_lateral_left"} <= landmarks(sports).keys()


def test_a_subjects_name_among_many_points_without_a_name() -> None:
    labels = [*(f"Jim_{label}" for label in PLUG_IN_GAIT.split()), *(f"*{k}" for k in range(50))]
    assert landmarks(labels) == landmarks(PLUG_IN_GAIT.split())


def test_the_points_of_xsens_mvn() -> None:
    labels = ["pSacrum", "pC7SpinalProcess", "pTopOfHead"] + [
        f"p{side}{name}"
        for side in ("Right", "Left")
        for name in ("ASI", "PSI", "KneeLatEpicondyle", "KneeMedEpicondyle", "LatMalleolus", "MedMalleolus",
                     "FirstMetatarsal", "FifthMetatarsal", "Acromion")
    ]  # fmt: skip
    found = {
        name: [without_subject(labels)[k] for k in markers] for name, markers in landmarks(labels).items()
    }
    assert found["knee_lateral_left"] == ["LeftKneeLatEpicondyle"]
    assert found["ankle_medial_right"] == ["RightMedMalleolus"]
    assert found["toes_left"] == ["LeftFirstMetatarsal", "LeftFifthMetatarsal"]
    assert {"asis_left", "psis_right", "acromion_left", "neck_back", "head"} <= found.keys()


@pytest.mark.parametrize(
    ("label", "landmark"),
    [("LEP", "knee_lateral"), ("MEP", "knee_medial"), ("KNI", "knee_medial"), ("LCON", "knee_lateral"),
     ("LML", "ankle_lateral"), ("MML", "ankle_medial"), ("MMA", "ankle_medial"), ("ANI", "ankle_medial")],
)  # fmt: skip
def test_short_labels(label: str, landmark: str) -> None:
    assert landmarks([f"R{label}", f"L{label}"]) == {f"{landmark}_left": (1,), f"{landmark}_right": (0,)}


def test_the_labels_of_bts_and_sias() -> None:
    """Those of Davis et al. as BTS's programs write them; SIAS and SIPS are Latin for ASIS and PSIS."""
    labels = [
        "sacrum",
        *(f"{s} {n}" for s in "lr" for n in ("asis", "bar 1", "knee 1", "mall", "met", "should")),
    ]
    found = landmarks(labels)
    for k, name in enumerate(("asis", "", "knee_lateral", "ankle_lateral", "toes", "acromion"), 1):
        if name:
            assert (found[f"{name}_left"], found[f"{name}_right"]) == ((k,), (k + 6,))
    found = landmarks(["LSIAS", "RSIAS", "LSIPS", "RSIPS"])
    assert found == {"asis_left": (0,), "asis_right": (1,), "psis_left": (2,), "psis_right": (3,)}


@pytest.mark.parametrize(
    "labels",
    [
        "LLEK LMEK LLM LMM LLEE LMEE",  # Motek's Human Body Model
        "L_LatKnee L_MedKnee L_LatAnkle L_MedAnkle L_LatElbow L_MedElbow",
        "LLK LMK LLA LMA LELB",
        "LKNE LKNM LANK LMED LELB",  # the Conventional Gait Model 2
        "LLKNEE LMKNEE LLANKLE LMANKLE LELBOW",
        "LLatKnee LMedKnee LLatAnk LMedAnk LElbow",
        "KneeLat_L KneeMed_L AnkleLat_L AnkleMed_L Elbow_L",
        "Left Lateral Knee,Left Medial Knee,Left Lateral Ankle,Left Medial Ankle,Left Elbow",
        "L_LatEpicondyle L_MedEpicondyle L_LatMalleolus L_MedMalleolus L_Elbow",
        "LKNEL LKNEM LANKL LANKM LELB",
        "L_LFE L_MFE L_AnkLat L_AnkMed L_Elbow",
    ],
)
def test_lateral_and_medial_markers(labels: str) -> None:
    found = landmarks(labels.split("," if "," in labels else None))
    for number, landmark in enumerate(("knee_lateral", "knee_medial", "ankle_lateral", "ankle_medial")):
        assert found[f"{landmark}_left"] == (number,)
    assert "elbow_left" in found
    # An arm beside an ankle with a full name is no ankle.
    assert landmarks(["LLA", "LAnkle"])["ankle_lateral_left"] == (1,)


def test_a_side_or_a_word_of_a_few_labels_is_no_subject() -> None:
    for labels in (
        ["L_IAS", "L_FLE", "L_FAL", "L_FCC", "L_FM2"],
        ["left knee lat", "left ankle lat", "left asis", "left toe", "left heel"],
        ["Top.Head"],
        ["V.Sacral", "L.ASIS", "R.ASIS"],
        ["New 0001", "New 0002", "New 0003", "New 0004", "New 0005"],
        ["", "", ""],
    ):
        assert without_subject(labels) == tuple(labels)


@pytest.mark.parametrize("prefix", ["", "Bob:", "Bob_"])
def test_computed_joint_centres(prefix: str) -> None:
    labels = [prefix + s + joint + "JC" for s in "LR" for joint in "HKASEW"]
    found = joint_centres(labels)
    for number, joint in enumerate(("hip", "knee", "ankle", "shoulder", "elbow", "wrist")):
        assert (found[f"{joint}_left"], found[f"{joint}_right"]) == (number, number + 6)
    assert joint_centres(["RHJC_study"]) == {"hip_right": 0}


def test_what_many_markers_end_in_is_no_joints_name() -> None:
    assert not joint_centres(MOTIVE.split()).keys() & {"knee_left", "ankle_left", "shoulder_left"}


def test_a_marker_on_the_thigh_is_no_hip() -> None:
    helen_hayes = [f"{s}.{part}" for s in "LR" for part in ("ASIS", "Thigh", "Knee", "Shank", "Ankle", "Toe")]
    assert not joint_centres(helen_hayes).keys() & {"hip_left", "hip_right"}
    assert landmarks(helen_hayes)["knee_lateral_right"] == (8,)
    # Hips that are there are the hips.
    with_hips = [*helen_hayes, "L.Hip", "R.Hip"]
    assert with_hips[joint_centres(with_hips)["hip_right"]] == "R.Hip"
    # Of bones the upper ends are the joints.
    bones = [f"{s}_{part}" for s in "lr" for part in ("thigh", "shank", "foot")]
    assert [joint_centres(bones)[f"{joint}_left"] for joint in ("hip", "knee", "ankle")] == [0, 1, 2]


def test_a_marker_on_the_shank_is_no_hip() -> None:
    labels = [f"Jim_{s}.{part}" for s in "LR" for part in ("ASIS", "Leg", "Knee", "Ankle", "Toe")]
    assert joint_centres(labels).keys() & {"hip_left", "hip_right", "knee_left"} == {"knee_left"}


def test_the_waist_of_the_cmu_library() -> None:
    found = landmarks([f"Jim:{s}{part}" for s in "LR" for part in ("FWT", "BWT", "KNE", "ANK")])
    assert (found["asis_left"], found["psis_right"]) == ((0,), (5,))
