"""The catalogue of public recordings: what each is, where it is, fetching and verifying it."""
