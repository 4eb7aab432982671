"""From optical markers to joint centres: known labels and marker sets of one's own, regressions, units. In:
the labels and positions that a reader found. Out: a `Clip` of the nodes that they give.
"""
