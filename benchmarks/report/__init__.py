"""The leaderboard of a suite: statistics, standings, tables, plots and the page."""
