"""The pages of a run folder, with their figures and templates.

In: the numbers of `metrics`, the trajectory, and the files of the run folder. Out: report.html,
gait_report.html and index.html.
"""
