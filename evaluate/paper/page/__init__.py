"""The study's page, and the figures and CSV tables in addition to it."""
