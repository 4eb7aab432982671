"""Fit a body of constant lengths to the points that a network sees in a video.

In: points in the image with their certainty, rough places in metres (`Observed`), the height of the person
and the field of view. Out: poses, camera and lengths in one scene whose floor is level (`FittedBody`).
One sparse least-squares problem over the clip: the points in the image, the rough depth, feet that stand on
the floor, limits of the joints, smoothness, and what is expected of lengths and camera.
"""
