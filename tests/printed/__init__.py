"""The blocks of README.md and docs/, which of their commands a test runs, and in which folder."""
