"""Random rigs that nobody tuned the identifier to, simulated, identified and judged: `pvid campaign`.

population: which rigs; pivot: their drives; truth: what their sensors record; bound: what the record determines;
judge: what an answer is worth; run: all of that in parallel; table: the result in words.
"""
