"""Tests; a package so that `tests.simulators` can be imported from examples and other tests."""
