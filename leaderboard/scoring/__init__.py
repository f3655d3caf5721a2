"""How events and progress become a score, and what people call events."""
