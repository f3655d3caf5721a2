"""What is wrong with a study, in a sentence for whoever asked for it."""


class StudyError(Exception):
    """A study that cannot be driven, continued or read; the message says what to do."""
