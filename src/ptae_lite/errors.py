"""The library's own errors: one clear sentence each, saying what was wrong, what was expected and what to do."""


class PTAEError(Exception):
    """Base of every error that `ptae_lite` raises on purpose."""


class LanguageError(PTAEError):
    """A word, sentence, signal or pattern outside the grammar."""


class RobotError(PTAEError):
    """A pose outside the joint limits, a point out of reach, or a simulator that is not installed."""


class RecordingError(PTAEError):
    """A folder that is not a recording of ours, or a sample whose arrays disagree."""


class ArtefactError(PTAEError):
    """A stored file that is missing, damaged, or made from something else than it should be."""


class ConfigError(PTAEError):
    """A setting that does not exist or has a value that makes no sense."""
