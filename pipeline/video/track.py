"""Follow one person through a video: detect once, then find each frame's region from the frame before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.video.decode import Image
from kinemimic.pipeline.video.detector import Detection, Detector
from kinemimic.pipeline.video.landmarks import MIN_PRESENCE, LandmarkNetwork, Landmarks
from kinemimic.pipeline.video.region import Region

# Without a person, the detector looks at every nth frame only.
_SEARCH_EVERY = 3
# How far from the last place a lost person is looked for, in sides of the last region: at once, and more per
# frame. Somebody elsewhere is another person, until there was time to walk there.
_REACH, _REACH_PER_FRAME = 0.5, 1.0 / 60.0
# Nor has a person who is found again more than this times the size.
_GROWTH = 2.0


@dataclass(frozen=True)
class Followed:
    """How far a person was followed.

    last: where the person was expected after the last frame that showed one, None if none did; lost: frames
    since then; frames: number of frames so far.
    """

    last: Region | None = None
    lost: int = 0
    frames: int = 0

    @property
    def region(self) -> Region | None:
        """Where the person is expected in the next frame, or None."""
        return None if self.lost else self.last


class PersonTracker:
    """The landmarks of one person, frame by frame.

    person: None follows the largest person of the first frame that shows one; 1, 2, … the person of that
    number from the left, in the first frame that shows so many. A person who is lost is looked for near the
    last place. followed: by an earlier call, which this one continues.
    """

    def __init__(
        self,
        detector: Detector,
        network: LandmarkNetwork,
        *,
        person: int | None = None,
        followed: Followed | None = None,
    ) -> None:
        self._detector, self._network, self._person = detector, network, person
        self.followed = followed or Followed()
        """After the last frame that was completed: Ctrl-C may end a frame halfway."""
        self.most_people = 0
        """The most people that the detector has seen in one image."""

    def __call__(self, image: Image) -> Landmarks | None:
        """The landmarks in the next frame (H, W, 3); None if the person is not seen."""
        before = self.followed
        found = self._look(image, before)
        if found is None:
            self.followed = Followed(before.last, before.lost + 1, before.frames + 1)
        else:
            self.followed = Followed(found.region, frames=before.frames + 1)
        return found

    def _look(self, image: Image, before: Followed) -> Landmarks | None:
        if before.region is not None:
            found = self._at(image, before.region)
            if found is not None:
                return found
        elif before.frames % _SEARCH_EVERY:
            return None
        region = self._search(image, before)
        return None if region is None else self._at(image, region)

    def _at(self, image: Image, region: Region) -> Landmarks | None:
        found = self._network(image, region)
        return None if found.score < MIN_PRESENCE or not found.region.inside(image) else found

    def _search(self, image: Image, before: Followed) -> Region | None:
        people = self._detector.people(image)
        self.most_people = max(self.most_people, len(people))
        chosen = self._choice(people, before)
        if chosen is None:
            return None
        region = Region.about(chosen.centre, chosen.circle)
        return region if region.inside(image) else None

    def _choice(self, people: list[Detection], before: Followed) -> Detection | None:
        if not people:
            return None
        last = before.last
        if last is not None:
            reach = last.side * (_REACH + _REACH_PER_FRAME * (before.lost + 1))
            near = [
                (distance, k)
                for k, one in enumerate(people)
                if (distance := float(np.linalg.norm(one.centre - last.centre))) <= reach
                and 1.0 / _GROWTH < Region.about(one.centre, one.circle).side / last.side < _GROWTH
            ]
            return people[min(near)[1]] if near else None
        if self._person is None:
            return people[0]
        from_left = sorted(people, key=lambda one: float(one.centre[0]))
        return from_left[self._person - 1] if self._person <= len(from_left) else None
