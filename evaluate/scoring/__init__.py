"""Scores of a policy and gait metrics, with their reports.

In: a run folder with motion and policy, and optionally the capture. Out: trajectory.npz, scores.json,
curves.csv and report.html; gait_report.json and gait_report.html. The numbers come from `metrics`, the pages
from `reports`.
"""
