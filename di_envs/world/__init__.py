"""The world: its state as a value, and the kernels that move it; the only place where time moves."""
