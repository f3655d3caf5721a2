"""Many worlds at once: what a vector environment does for all of them together."""
