"""A virtual Kinect without any error."""

from __future__ import annotations

from kinemimic.pipeline.virtual_kinect.noise import NoiseLevels

NOISELESS = NoiseLevels(
    white=0.0,
    bias=0.0,
    hip_width=1.0,
    hip_yaw=0.0,
    foot_drop=0.0,
    flicker=0.0,
    inferred=0.0,
    lost=0.0,
    swap=0.0,
    edge=0.0,
    edge_frames=(0, 0),
)
