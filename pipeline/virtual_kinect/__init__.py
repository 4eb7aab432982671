"""A simulated Kinect v1. In: a stock motion (walk or run) of the pybullet wheel. Out: recordings as files,
with strides that vary as people's do, with the noise, states and gaps of the real sensor, and beside each
its truth (NAME.truth.parquet) and how it was made (NAME.provenance.json). Tests of accuracy compare the
pipeline's result with that truth; nothing here uses the pipeline's own model of a gait.
"""
