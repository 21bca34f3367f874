"""UserError: base class of every error that the user can correct, for all packages and the command line."""


class UserError(Exception):
    """An error in the user's input: the message says where, what is wrong, and the likely cause.

    The command line prints the message as one line. Any other exception is a defect and keeps its traceback.
    """
