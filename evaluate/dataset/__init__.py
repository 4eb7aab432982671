"""The data set of a folder of batches: built from the rows and run folders, with a card and a page.

In: the rows that batches keep, and the motions in their run folders. Out: `dataset/` and `index.html`.
"""
