"""The agent `expert`: rules over the true state of the world, as kernels."""
