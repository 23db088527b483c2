"""Named errors of the engine. Each message is one sentence: what was found, and what to do about it."""


class GssmcError(Exception):
    """Base of every error that a user may meet; `str(error)` is fit to be shown as it is."""


class SplatFormatError(GssmcError):
    """A splat file cannot be read as a Gaussian scene."""


class PhotoError(GssmcError):
    """A photograph cannot be decoded, or does not fit its camera."""


class CameraError(GssmcError):
    """A camera description is incomplete, or its numbers make no camera."""


class DatasetError(GssmcError):
    """A file or folder of poses cannot be read, or does not fit another one."""


class FeatureError(GssmcError):
    """Features or a matcher cannot be used: unknown, without a model file, or with one that does not work."""


class RefineError(GssmcError):
    """A refinement cannot start or go on with what it was given."""


class ProxyError(GssmcError):
    """A proxy mesh cannot be made of a scan, or cannot be written."""


class Cancelled(GssmcError):  # noqa: N818 - says what happened; it is no fault
    """The user stopped the work; nothing was changed."""


class UsageError(GssmcError):
    """The command line itself is wrong."""
