"""The folder of the data that ships: catalog.toml, policies, scenarios, the comparison."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

DATASETS = Path(str(files("kinemimic.datasets").joinpath("catalog.toml"))).parent
