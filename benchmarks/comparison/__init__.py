"""Suites that tell controllers apart: cases, runs, figures, statistics, leaderboards."""
