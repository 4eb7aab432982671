"""A page that knows whether somebody looks."""

from __future__ import annotations

from kinemimic.evaluate.simulate.page import Page


class ViewedPage(Page):
    """The page of a session, with its viewers."""

    def viewers(self) -> int:
        """How many browsers are connected."""
        return len(self._server.get_clients())
