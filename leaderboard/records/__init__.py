"""What is kept of a run: values, their files, their hashes, and what they rest on."""
