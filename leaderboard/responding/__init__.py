"""Responses of a policy over recorded drives: measured, kept, drawn, and put to the test."""
