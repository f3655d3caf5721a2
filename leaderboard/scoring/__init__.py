"""How events and progress become scores: rules as named data, scores as functions of values."""
