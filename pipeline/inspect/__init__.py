"""`kinemimic inspect`: what a capture is, how good it is, and what will be done to it."""
