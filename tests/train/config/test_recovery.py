"""Settings of recoveries, in a configuration and its JSON."""

from __future__ import annotations

from dataclasses import replace

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.config.recovery import Recovery

CONFIG = replace(PRESETS["default"], recovery=Recovery(directions=(180.0, 45.0)))


def test_a_configuration_with_recoveries_is_read_back() -> None:
    assert TrainConfig.from_json(CONFIG.to_json()) == CONFIG
    assert "recovery" not in PRESETS["default"].to_json()


@pytest.mark.parametrize(
    ("name", "value"),
    [("phases", 0), ("rounds", 0), ("humanoids", 0), ("forces", []), ("forces", [0.0, 100.0]), ("elite", 31)],
)
def test_damaged_numbers_are_refused(name: str, value: object) -> None:
    stored = CONFIG.to_json()
    stored["recovery"][name] = value
    with pytest.raises(
        KinemimicError, match=rf"^x\.json, key recovery\.{name}.*: expected .*, found "
    ) as error:
        TrainConfig.from_json(stored, "x.json")
    assert "\n" not in str(error.value)
