"""The one exception a user meets: a line that names the thing and the way out."""


class InputError(Exception):
    """Bad input, configuration or surroundings.

    The message is one line for a person: what is wrong, where, and what to do. The commands print it and exit with
    status 2; nothing already stored is lost.
    """
