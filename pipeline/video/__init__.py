"""See a person in a video: 33 points of the body per frame, by the networks of BlazePose.

In: a video file. Out: `LandmarkTrack`, which is kept in the run folder so that an interrupted run goes on
where it was. The networks run on the CPU (the extra `video`).
"""
