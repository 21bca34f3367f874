"""The base of every error that is about input and not about the program."""


class Mistake(Exception):
    """What a user can mend: the message alone says what is wrong, where, and what would help.

    The command line prints it as one line; anything else is a defect and keeps its traceback.
    """
