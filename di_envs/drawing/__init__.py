"""Views for people: the streets around the ego from above, the prompt in words, and a window."""
