"""`kinemimic inspect` and `kinemimic formats`: what a capture file is, how good it is, what `ingest` will do.

In: paths of files or folders. Out: a report per file as JSON values (`file_report`), shown as a page for one
file, a table for many, JSON, or an HTML page of curves.
"""
