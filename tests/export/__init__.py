"""Tests of what leaves Linkwork."""
