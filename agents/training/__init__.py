"""Data, training and evaluation of imitation policies: what makes the weights that are shipped."""
