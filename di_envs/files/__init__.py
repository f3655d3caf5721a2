"""What every file of ours goes through: typed JSON, whole-file writes, numbers as short text."""
