"""`kinemimic overlay`: draw the tracked skeleton into the images of a video or a depth recording.

In: the video or recording, and optionally the run made from it. Out: a video file.
"""
