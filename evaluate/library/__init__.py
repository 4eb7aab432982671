"""Motion libraries: the accepted motions of many captures, and variants of them, as one set of arrays.

In: captures. Out: a folder that `train-tracker` reads.
"""
