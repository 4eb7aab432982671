"""`kinemimic datasets`: the commands on recordings, and on data sets made of them."""

from __future__ import annotations

import click

from kinemimic.pipeline.cli.lazy_group import LazyGroup

# As in the command line's own table: named in strings, because some lie in layers above this one.
COMMANDS: dict[str, tuple[str, str]] = {
    "list": ("kinemimic.pipeline.catalog.listing:command", "What the catalogue has, and what of it is here."),
    "fetch": ("kinemimic.pipeline.catalog.fetch:command", "Get recordings, each with the right hash."),
    "verify": ("kinemimic.pipeline.catalog.verify:command", "Compare what is here with the catalogue."),
    "add": ("kinemimic.pipeline.catalog.add:command", "A file into a catalogue of one's own."),
    "record": (
        "kinemimic.pipeline.virtual_kinect.command:command",
        "What a virtual Kinect records, as files.",
    ),
    "build": ("kinemimic.retarget.versions.build:command", "A capture of a versioned data set, made."),
    "score": (
        "kinemimic.evaluate.workflow.score_lock:command",
        "A policy that ships: still as good as on record?",
    ),
    "lock": ("kinemimic.retarget.versions.manifest:command", "Say what a version of a data set is."),
    "check": ("kinemimic.retarget.versions.check:command", "Is a data set what was locked?"),
    "diff": ("kinemimic.retarget.versions.diff:command", "What changed between two data sets, as motion."),
}


@click.group("datasets", cls=LazyGroup, lazy=COMMANDS)
def command() -> None:
    """Public recordings of real sensors, from a catalogue; and versions of what is made of recordings.

    \b
      kinemimic datasets list
    """
