"""One module per rule, named after the defects that it reports (the keys of `defect.RULES`).

A rule that can correct the clip has `repair(clip) -> (clip, defects)`; a rule that only reports has
`detect(clip) -> defects`. Shared by the rules, the passes and the readers: `defect`, `length_units`,
`frame_selection`, `repeated_poses`, `swap_sides`.
"""
