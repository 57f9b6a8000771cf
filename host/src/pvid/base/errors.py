"""The one exception that is meant for the user."""


class PvidError(Exception):
    """Bad input or usage, told in one clear sentence.

    The command line prints the sentence on stderr and exits with code 2; a traceback would tell no more.
    """
