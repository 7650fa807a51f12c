"""The library's own errors. A message says what was wrong, what was expected and what to do."""


class PTAEError(Exception):
    """Base of every error that `ptae_lite` raises on purpose."""


class LanguageError(PTAEError):
    """A word, sentence, signal or pattern outside the grammar."""


class RobotError(PTAEError):
    """A pose outside the limits, a point out of reach, or a simulator that is not installed."""


class RecordingError(PTAEError):
    """A folder that is no recording of ours, a wrong file of the authors', arrays that disagree."""


class ArtefactError(PTAEError):
    """A stored file that is missing, is damaged, or was made from something else than expected."""


class ConfigError(PTAEError):
    """A setting that does not exist or has a value that makes no sense."""


class FileError(PTAEError):
    """A place that cannot be written to, or that another run is using."""


class TrainingError(PTAEError):
    """A training whose losses are no numbers any more."""
