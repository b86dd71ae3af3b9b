"""Trials in which an effect is hidden, made without the package's plant, to judge diagnoses by.

`physics` simulates; nothing in it imports pma_gym. `draw` makes cases, `judge` has them diagnosed,
`score` counts what was named right.
"""
