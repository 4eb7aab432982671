"""From judged bouts to the gait loop: the bouts that are pooled, their strides, and the average stride.

In: a clip on the 20 nodes and its bouts (pipeline/locomotion). Out: the selected bouts, pooled strides, the
reliability of the sensor, and the loop as Fourier series; or the excerpt that is kept as recorded.
"""
