"""From a route file to a dense route with commands, and the scenarios that it meets."""
