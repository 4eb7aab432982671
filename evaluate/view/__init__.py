"""A run as a rerun recording, with screenshots and videos of it.

In: trajectory, motion, scores and capture of a run, or a scenario trial. Out: view.rrd, PNG, WebM or MP4.
"""
