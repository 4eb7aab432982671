"""`kinemimic inspect` and `kinemimic formats`: format and quality of capture files, effect of `ingest`.

In: paths of files or folders. Out: a report per file as JSON values (`file_report`), shown as a page for one
file, a table for many, JSON, or an HTML page of curves.
"""
