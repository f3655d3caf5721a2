"""What kernels are made of: how they are compiled, bundles of arrays, keyed draws, geometry."""
