"""Language models as agents: text in, waypoints or a manoeuvre out."""
