"""Tables whose columns the user describes in a TOML file. In: a table and the description beside it. Out: a
`Clip`. The `suggest*` modules draft a description for an unknown table, for the user to check.
"""
