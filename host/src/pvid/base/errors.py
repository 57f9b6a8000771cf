"""The one exception that is meant for the user."""


class PvidError(Exception):
    """Bad input or usage, explained in one sentence.

    The command line prints the sentence on stderr and exits with code 2; a traceback would not help.
    """
