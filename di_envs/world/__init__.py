"""The world: its state as a value, and the kernels that move it; here alone time moves."""
