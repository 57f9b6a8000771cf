"""The road from a recording to an answer.

reading (the samples) -> analysis (weak form in float64) -> advice (wrong columns) -> refinement (full equations) ->
judge (prediction of unseen motion) -> answer; `road` walks it. `core`, `core_refined` and `strong` ask the C
core beside it; `validation` predicts another recording.
"""
