"""The scripts here need other libraries: `make test-integrations` runs them, pytest does not."""

collect_ignore_glob = ["*.py"]
