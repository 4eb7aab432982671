"""Quality control of captures: division into passes, detection and repair of defects, the quality report.

In: a `Clip` as a reader returned it. Out: the repaired clip with numbered passes, a list of `Defect`s, and
quality.json.
"""
