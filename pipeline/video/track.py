"""Follow one person through a video: detect once, then find each frame's region from the frame before."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.video.decode import Image
from kinemimic.pipeline.video.detector import Detection, Detector
from kinemimic.pipeline.video.landmarks import MIN_PRESENCE, LandmarkNetwork, Landmarks
from kinemimic.pipeline.video.region import Region

# Without a person, the detector looks at every so many frames only.
_SEARCH_EVERY = 3
# How far from the last place a lost person is looked for, in sides of the last region: at once, and more per
# frame. Somebody elsewhere is another person, until there was time to walk there.
_REACH, _REACH_PER_FRAME = 0.5, 1.0 / 60.0
# Nor has a person who is found again more than this times the size.
_GROWTH = 2.0


class PersonTracker:
    """The landmarks of one person, frame by frame.

    person: None follows the largest person of the first frame that shows one; 1, 2, … the person of that
    number from the left, in the first frame that shows so many. A person who is lost is looked for near the
    last place.
    """

    def __init__(
        self,
        detector: Detector,
        network: LandmarkNetwork,
        *,
        person: int | None = None,
        region: Region | None = None,
    ) -> None:
        self._detector, self._network, self._person = detector, network, person
        self.region = region
        """Where the person is expected in the next frame, or None."""
        self._last = region
        self._frame = self._lost = 0
        self.most_people = 0
        """The most people that the detector has seen in one image."""

    def __call__(self, image: Image) -> Landmarks | None:
        """The landmarks in the next frame (H, W, 3); None if the person is not seen."""
        self._frame += 1
        self._lost += 1
        if self.region is not None:
            found = self._at(image, self.region)
            if found is not None:
                return found
        elif (self._frame - 1) % _SEARCH_EVERY:
            return None
        region = self._search(image)
        return None if region is None else self._at(image, region)

    def _at(self, image: Image, region: Region) -> Landmarks | None:
        found = self._network(image, region)
        if found.score < MIN_PRESENCE or not found.region.inside(image):
            self.region = None
            return None
        self.region = self._last = found.region
        self._lost = 0
        return found

    def _search(self, image: Image) -> Region | None:
        people = self._detector.people(image)
        self.most_people = max(self.most_people, len(people))
        chosen = self._choice(people)
        if chosen is None:
            return None
        region = Region.about(chosen.centre, chosen.circle)
        return region if region.inside(image) else None

    def _choice(self, people: list[Detection]) -> Detection | None:
        if not people:
            return None
        last = self._last
        if last is not None:
            reach = last.side * (_REACH + _REACH_PER_FRAME * self._lost)
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
