"""Tables and JSON of joints that nobody described. In: a `Source` in which the joints are certain. Out: a
`Clip`, read with the description that `custom_table.suggest` drafts for it.
"""
