"""Tests of people as agents."""
