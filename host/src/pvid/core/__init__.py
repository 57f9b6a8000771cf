"""The shipped C core, loaded from its shared library."""
