"""The paper's numbers, ours beside each, and the verdict.

In: a comparison and the rows of the experiments. Out: claims, and their summary as Markdown.
"""
