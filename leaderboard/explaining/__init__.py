"""A route explained: looks into its policy, questions of what if, and their answers."""
