"""The named errors of the project: what went wrong, and what to do next.

Every message is one line for a person: the command line prints it as it is and exits with 2.
"""


class NaoimitateError(Exception):
    """A mistake in what the user or the data gave us; the message says what to do."""


class MotionFormatError(NaoimitateError):
    """A motion file cannot be read: damaged, empty, of an unknown format or skeleton."""


class RobotModelError(NaoimitateError):
    """A robot's data are missing, contradictory or physically impossible."""


class CalibrationError(NaoimitateError):
    """A posture cannot serve as the T-pose, or a subject file cannot be used."""


class SettingsError(NaoimitateError):
    """A choice that does not exist."""


class UnreachablePose(NaoimitateError):
    """No pose satisfies the hard constraints asked for."""


class RunFileError(NaoimitateError):
    """A run file is damaged or does not follow ``naoimitate-run/1``."""


class RenderingUnavailable(NaoimitateError):
    """No off-screen GL was found; the program goes on without pictures."""


class DatagramError(NaoimitateError):
    """A datagram is damaged, or not of the protocol that was asked for."""


class StreamError(NaoimitateError):
    """A stream cannot be received or recorded: port in use, nothing comes, another protocol comes."""


class DriverError(NaoimitateError):
    """A robot cannot be reached, or refuses to be driven."""


class UnknownTask(NaoimitateError):
    """There is no tele-operated task of that name."""
