"""`kinemimic overlay`: draw the tracked skeleton into the images of a depth recording.

In: a depth recording, and optionally the run made from it. Out: a video file. `video` also writes the films
of `kinemimic view`.
"""
