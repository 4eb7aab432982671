"""The joint sets of live senders, told apart by their number of joints.

20: a Kinect v1's, our nodes; 25: a Kinect v2's; 32: the Azure Kinect's; 33: MediaPipe's pose landmarks.
"""

from __future__ import annotations

from kinemimic.pipeline.readers.landmarks.joint_sets import (
    AZURE_KINECT,
    KINECT_V1,
    KINECT_V2,
    MEDIAPIPE,
    JointSet,
)

LAYOUTS: dict[int, JointSet] = {
    len(layout.joints): layout for layout in (KINECT_V1, KINECT_V2, AZURE_KINECT, MEDIAPIPE)
}
