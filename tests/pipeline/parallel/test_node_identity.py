"""A node whose results would differ is refused in one line."""

from __future__ import annotations

from dataclasses import replace

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.node_identity import NodeIdentity

HERE = NodeIdentity.here({"engine": "3, double"})


def test_a_node_like_this_one_is_taken() -> None:
    HERE.require(NodeIdentity.here({"engine": "3, double"}), "10.0.0.2")


@pytest.mark.parametrize(
    ("driver", "node", "message"),
    [
        (
            HERE,
            NodeIdentity.here({"engine": "2, double"}),
            "expected engine 3, double .* found 2, double; install",
        ),
        (HERE, NodeIdentity.here(), "expected engine 3, double as on the driver, found None; install"),
        (
            HERE,
            replace(HERE, processor=(*HERE.processor, "amx")),
            r"found another \(amx\); results would differ",
        ),
        (replace(HERE, processor=(*HERE.processor, "sve")), HERE, r"found another \(no sve\); results would"),
    ],
)
def test_a_node_of_another_kind_is_one_line(driver: NodeIdentity, node: NodeIdentity, message: str) -> None:
    with pytest.raises(KinemimicError, match=f"node 10.0.0.2: .*{message}") as refusal:
        driver.require(node, "10.0.0.2")
    assert "\n" not in str(refusal.value)
