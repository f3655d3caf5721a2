"""A whole training as one file: stages in order, each resumable, from nothing to the weights."""
