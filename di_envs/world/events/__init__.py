"""What the rules count, each by the rule of its own module, and progress along the route."""
