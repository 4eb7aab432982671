from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.numpy import save_file

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.humanoid import body
from kinemimic.train.config.baseline_config import Activation
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.ppo.networks import ActorCritic, Normalizer, export
from kinemimic.train.rollout.evaluation import Evaluation
from kinemimic.train.rollout.policy import Policy, read_record
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.observation import OBSERVATIONS, observation_size

POLICIES = Path(__file__).parents[3] / "datasets/policies"
RECORD: dict[str, object] = {"config": PRESETS["default"].to_json(), "provenance": {}, "mirrored": True}


@pytest.fixture
def learner() -> tuple[ActorCritic, Normalizer]:
    torch.manual_seed(0)
    normalizer = Normalizer(OBSERVATIONS)
    normalizer.update(np.random.default_rng(0).normal(1.0, 3.0, (50, OBSERVATIONS)))
    return ActorCritic(OBSERVATIONS, ACTIONS, (16, 8), 0.1), normalizer


def test_stored_policy_acts_as_the_network_does(tmp_path: Path, learner) -> None:
    net, normalizer = learner
    observations = np.random.default_rng(1).normal(1.0, 30.0, (5, OBSERVATIONS)).astype(np.float32)
    export(net, normalizer).save(tmp_path / "p.safetensors", RECORD | {"samples": 7})
    policy, record = Policy.load(tmp_path / "p.safetensors")
    wanted = net.actor.forward(normalizer.apply(observations)).numpy()
    np.testing.assert_allclose(policy.act(observations), wanted, rtol=1e-4, atol=1e-7)
    assert record["samples"] == 7


@pytest.mark.parametrize(("activation", "bound"), [("tanh", None), ("relu", 0.5)])
def test_acting_one_by_one_does_not_depend_on_the_batch_to_the_bit(
    learner, activation: Activation, bound: float | None
) -> None:
    policy = replace(export(*learner), activation=activation, bound=bound)
    observations = np.random.default_rng(1).normal(1.0, 3.0, (7, OBSERVATIONS))
    actions = policy.act_one_by_one(observations)
    np.testing.assert_allclose(actions, policy.act(observations), atol=1e-5)
    alone = np.concatenate([policy.act(row[None]) for row in observations])
    assert actions.tobytes() == alone.tobytes()


def test_a_damaged_policy_is_one_clear_line(tmp_path: Path, learner) -> None:
    path = tmp_path / "p.safetensors"
    with pytest.raises(KinemimicError, match="found none"):
        Policy.load(path)
    export(*learner).save(path, RECORD)
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(KinemimicError, match="found a file that is cut off or damaged; train again"):
        Policy.load(path)


def test_a_policy_of_another_shape_than_its_configuration_says_is_refused(tmp_path: Path, learner) -> None:
    path = tmp_path / "p.safetensors"
    export(ActorCritic(10, ACTIONS, (4,), 0.1), Normalizer(10)).save(path, RECORD)
    with pytest.raises(KinemimicError, match="found 10 and 42"):
        Policy.load(path)
    config = replace(PRESETS["default"], env=replace(PRESETS["default"].env, preview=(1, 2)))
    size = observation_size(config.env)
    export(*learner).save(path, RECORD | {"config": config.to_json()})
    with pytest.raises(KinemimicError, match=f"expected {size} observations .* found {OBSERVATIONS} and"):
        Policy.load(path)
    export(ActorCritic(size, ACTIONS, (4,), 0.1), Normalizer(size)).save(
        path, RECORD | {"config": config.to_json()}
    )
    assert Policy.load(path)[0].shape == (size, ACTIONS)


@pytest.mark.parametrize("change", ["mean", "scale", "actor.0.bias", "actor.1.weight"])
def test_layers_that_do_not_fit_together_are_refused(tmp_path: Path, learner, change: str) -> None:
    tensors = export(*learner).tensors()
    tensors[change] = tensors[change][..., :-1]
    Policy.from_tensors(tensors, PRESETS["default"]).save(tmp_path / "p.safetensors", RECORD)
    with pytest.raises(KinemimicError, match="found 0 and 0"):
        Policy.load(tmp_path / "p.safetensors")


@pytest.mark.parametrize(
    ("name", "change", "found"),
    [
        ("actor.0.weight", lambda t: t * np.float32(np.nan), "infinite or NaN"),
        ("actor.1.bias", lambda t: t + np.float32(np.inf), "infinite or NaN"),
        ("mean", lambda t: t.astype(np.float64), "float64 of 1"),
        ("actor.0.weight", lambda t: t.astype(np.float16), "float16 of 2"),
        ("actor.0.bias", lambda t: t.astype(np.int32), "int32 of 1"),
        ("scale", lambda t: t > 0, "bool of 1"),
        ("mean", lambda t: t[0], "float32 of 0"),
        ("actor.0.weight", lambda t: t[None], "float32 of 3"),
        ("scale", lambda t: 0 * t, "above zero, found 0"),
        ("scale", lambda t: -t, "above zero, found -"),
    ],
)
def test_numbers_that_no_training_ends_with_are_refused(tmp_path: Path, learner, name, change, found) -> None:
    path, policy = tmp_path / "p.safetensors", export(*learner)
    policy.save(path, RECORD)
    tensors = policy.tensors()
    save_file({**tensors, name: np.array(change(tensors[name]))}, path)
    with pytest.raises(KinemimicError, match=rf"p\.safetensors: expected .*{found}.*; train again"):
        Policy.load(path)


@pytest.mark.parametrize("kind", ["F8_E4M3", "F4", "BF16", "X"])
def test_kinds_of_numbers_that_numpy_has_not_are_one_clear_line(tmp_path: Path, learner, kind: str) -> None:
    path = tmp_path / "p.safetensors"
    export(*learner).save(path, RECORD)
    content = path.read_bytes()
    end = 8 + int.from_bytes(content[:8], "little")
    header = json.loads(content[8:end])
    size = 8 * 4 * len(export(*learner).mean)
    header["mean"] |= {"dtype": kind, "shape": [size // {"F4": 4, "BF16": 16}.get(kind, 8)]}
    told = json.dumps(header).encode()
    path.write_bytes(len(told).to_bytes(8, "little") + told + content[end:])
    with pytest.raises(KinemimicError, match=r"p\.safetensors: expected .*; train again"):
        Policy.load(path)


def test_a_folder_in_place_of_a_policy_is_told(tmp_path: Path, learner) -> None:
    path = tmp_path / "p.safetensors"
    export(*learner).save(path, RECORD)
    path.unlink()
    path.mkdir()
    with pytest.raises(KinemimicError, match=r"p\.safetensors: expected a policy .*, found a folder"):
        Policy.load(path)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("seed", "<script>alert(1)</script>"),
        ("samples", 1.5),
        ("samples", True),
        ("seconds", "x"),
        ("preset", 5),
        ("mirrored", "no"),
        ("provenance", []),
        ("provenance", {"inputs": "x"}),
    ],
)
def test_a_record_whose_values_are_of_another_kind_is_refused(tmp_path: Path, learner, key, value) -> None:
    export(*learner).save(tmp_path / "p.safetensors", RECORD | {key: value})
    with pytest.raises(KinemimicError, match=rf"p\.json, key {key}.*: expected .*; train again"):
        Policy.load(tmp_path / "p.safetensors")


def test_a_record_of_another_version_is_named(tmp_path: Path, learner) -> None:
    export(*learner).save(tmp_path / "p.safetensors", RECORD | {"config": {"env": {}}})
    with pytest.raises(KinemimicError, match=r"p\.json, key config\.preset: expected a value, found none"):
        Policy.load(tmp_path / "p.safetensors")


def test_a_policy_of_an_earlier_schema_is_refused_with_what_to_do(tmp_path: Path, learner) -> None:
    path = tmp_path / "p.safetensors"
    export(*learner).save(path, RECORD)
    record = json.loads(path.with_suffix(".json").read_text())
    for other in (record | {"schema": 2}, [record]):
        path.with_suffix(".json").write_text(json.dumps(other))
        with pytest.raises(KinemimicError, match=r"schema 4, found (2|none).*train again"):
            Policy.load(path)


OLD_NAMES = {
    "evaluations": "trials",
    "robust_return": "endured",
    "domain_randomization": "hardships",
    "baseline": "rival",
    "num_envs": "environments",
    "epochs": "passes",
    "action_std": "noise",
    "learn_action_std": "learn_noise",
    "evaluation": "trial",
}


def with_old_names(value: Any) -> Any:
    """A record with the keys of schema 3."""
    if isinstance(value, dict):
        return {OLD_NAMES.get(key, key): with_old_names(item) for key, item in value.items()}
    return [with_old_names(item) for item in value] if isinstance(value, list) else value


@pytest.mark.parametrize("name", ["robust", "ddpg"])
def test_schema_3_is_upgraded_to_the_names_of_schema_4(tmp_path: Path, name: str) -> None:
    config = PRESETS[name]
    tried = Evaluation(64, 0.5, 1.0, 3, 4, 5, reward=0.25, knee=0.5, hip=-2.0, robust_return=0.75)
    new = {"evaluations": [tried.to_json()], "best": tried.to_json(), "config": config.to_json()}
    new["seconds_by"] = {"evaluation": 1.5}
    old = {**with_old_names(new), "schema": 3}
    assert old["trials"][0]["endured"] == old["best"]["endured"] == 0.75
    assert old["config"]["env"]["hardships"] == new["config"]["env"]["domain_randomization"]
    assert ("rival" in old["config"]) == (name == "ddpg")
    assert old["config"].keys() >= {"environments", "passes", "noise", "learn_noise"}
    (tmp_path / "p.json").write_text(json.dumps(old))
    record = read_record(tmp_path / "p.json")
    assert record == {**json.loads(json.dumps(new)), "schema": 4}
    assert TrainConfig.from_json(record["config"]) == config
    assert Evaluation(**record["best"]) == tried


@pytest.mark.parametrize("path", sorted(POLICIES.glob("*/policy.safetensors")), ids=lambda p: p.parent.name)
def test_a_shipped_policy_of_schema_3_is_the_same_after_the_upgrade(tmp_path: Path, path: Path) -> None:
    stored = json.loads(path.with_suffix(".json").read_text())
    policy, record = Policy.load(path)
    assert with_old_names(record) == with_old_names(stored) | {"schema": 4}
    policy.save(tmp_path / "p.safetensors", record)
    assert (tmp_path / "p.safetensors").read_bytes() == path.read_bytes()
    assert Policy.load(tmp_path / "p.safetensors")[1] == record


def test_a_record_that_lacks_its_configuration_is_refused(tmp_path: Path, learner) -> None:
    export(*learner).save(tmp_path / "p.safetensors", {"provenance": {}})
    with pytest.raises(KinemimicError, match=r"key config: expected a table, found none; train again"):
        Policy.load(tmp_path / "p.safetensors")


def test_a_policy_of_another_body_is_refused(
    tmp_path: Path, learner, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its corrections are angles that other motors turn into other torques."""
    stronger = tuple(replace(one, stiffness=2.0 * one.stiffness) for one in body.BODIES)
    path = tmp_path / "p.safetensors"
    export(*learner).save(path, RECORD)
    Policy.load(path)
    monkeypatch.setattr(body, "BODIES", stronger)
    with pytest.raises(KinemimicError, match=r"this version's body.*train again"):
        Policy.load(path)
