"""pvid beside other tools on the same recordings: `./tools/pvid bench peers`; a tool a file.

Each file has PACKAGE, what its environment needs, with its version ("": the product has it), RIGS, and
`fit(rig, run, guess)`, which gives values and standard errors (NaN: the tool gives none) by name, and what the tool
warns of ("": nothing).
"""
