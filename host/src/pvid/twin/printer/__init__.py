"""Prints the numpy twin of a C core from its C: a Python function a C function, the same operations in the same order.

    from pvid.twin.printer.program import printed_module

    twin = printed_module(sources, folders, macros)        # paths of .c files, of include folders; {"PVID_MAX_P": "6"}
    reason = twin.pvid_gate_passes_f32(gate, np.float32(2.0))

`program` has the entry point and the cache. `directives` reads the C with its comments and the names of its macros,
`syntax` what its parts read and write; `term` is an expression in Python. `translate` prints a unit on top of
`declared` (names and types), `arithmetic` (numbers), `memory` (pointers, arrays, tables), `expressions`, `statements`
and `loops`, each of which is a class whose base is the one before. `machine` is what printed code imports.

What the C means on a machine: float is np.float32, an integer a Python int that wraps where C wraps, a struct an object
with its fields, an array a list, a pointer that list and, where it may point inside, an offset (`x` and `x_at`); a
pointer to one struct is the struct. A construct without a translation is refused with its file and line.

Printed code and C share their numbers, not their memory: unions keep their members apart, and the copies of a published
estimate are copied as a whole.
"""
