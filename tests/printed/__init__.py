"""What README.md and docs/ print: their blocks, what a test runs of them, and in what."""
