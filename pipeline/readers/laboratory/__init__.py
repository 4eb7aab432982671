"""Exports of motion laboratories' software: Vicon Nexus, Qualisys Track Manager, OptiTrack Motive. In: a
`Source`. Out: a `Clip` of the joint centres that its markers, or its model, give.
"""
