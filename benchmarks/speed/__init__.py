"""Speed beside other simulators': `python -m benchmarks speed`.

`peers` is the table of what is measured and where it lives, `worker` the script that measures one
row in a peer's environment, `run` the rounds over all rows.
"""
