"""OpenSim's formats: markers in TRC and STO, generalised coordinates in MOT. In: a `Source`. Out: a `Clip` on
joint centres computed from the markers, or on the skeleton of the coordinates.
"""
