"""What README.md and docs/ print: their blocks, what of them runs in a test, and what a page finds when it does."""
