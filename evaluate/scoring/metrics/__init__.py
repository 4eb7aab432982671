"""The numbers of an evaluation: the scores of a policy, and the gait metrics of a run.

In: a motion, the trajectory of its rollouts, and optionally the capture. Out: the content of scores.json,
tracker_scores.json and gait_report.json, and the verdict in words.
"""
