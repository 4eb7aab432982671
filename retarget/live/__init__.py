"""A live capture on the Table 1 body, moment by moment: pose, path over the ground, and what happens when
the person is lost.
"""
