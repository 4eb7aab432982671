"""From capture files to clean clips: readers, quality rules, filters, kinematics, gait, writers, CLI.

In: recordings in any known format. Out: clips on named joints, cleaned and with quaternions, and reports on
their quality. The lowest folder: it imports nothing from retarget, train or evaluate.
"""
