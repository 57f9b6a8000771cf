"""The bit-exact twin of the C core: numpy float32, one module a C module, the same operations in the same order.

Rules of bit-exactness: float32 element operations + - * / and sqrt only, never a reduction of numpy's
(dot, @, sum, einsum), never libm. Arrays carry a trailing lane axis: one pass runs many identifiers, and every
operation is element-wise, so each lane has the bits of a run of its own.
"""
