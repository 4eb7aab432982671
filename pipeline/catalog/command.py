"""`kinemimic datasets`: commands for public recordings, and for versioned data sets made from them."""

from __future__ import annotations

import click

from kinemimic.pipeline.cli.lazy_group import LazyGroup

# Import paths as strings, as in `cli.main`, because some modules are in layers above this one.
COMMANDS: dict[str, tuple[str, str]] = {
    "list": (
        "kinemimic.pipeline.catalog.listing:command",
        "List the catalogue and the files that are present.",
    ),
    "fetch": ("kinemimic.pipeline.catalog.fetch:command", "Fetch recordings and check their hashes."),
    "verify": ("kinemimic.pipeline.catalog.verify:command", "Compare the local files with the catalogue."),
    "add": ("kinemimic.pipeline.catalog.add:command", "Add a file to your own catalogue."),
    "record": (
        "kinemimic.pipeline.virtual_kinect.command:command",
        "Record a motion with a virtual Kinect.",
    ),
    "build": ("kinemimic.retarget.versions.build:command", "Build a capture of a versioned data set."),
    "score": (
        "kinemimic.evaluate.workflow.score_lock:command",
        "Compare the scores of a shipped policy with its record.",
    ),
    "lock": ("kinemimic.retarget.versions.manifest:command", "Record the content of a data set version."),
    "check": ("kinemimic.retarget.versions.check:command", "Compare a data set with its lock."),
    "diff": ("kinemimic.retarget.versions.diff:command", "Compare two data sets in terms of motion."),
}


@click.group("datasets", cls=LazyGroup, lazy=COMMANDS)
def command() -> None:
    """Public recordings of real sensors, and versioned data sets made from them.

    \b
      kinemimic datasets list
    """
