"""The shipped C core in this process: its headers, its identifiers, their saved states."""
