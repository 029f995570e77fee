"""How the operator is seen: on our clock, whole, mirrored where wished, filtered, and watched for a T-pose."""

from __future__ import annotations

from dataclasses import replace

from naoimitate.calib.subject import Subject, calibrate
from naoimitate.core.errors import CalibrationError
from naoimitate.core.frames import HumanFrame
from naoimitate.human.mirror import mirrored_frame
from naoimitate.live.clock import SenderClock
from naoimitate.live.filter import LandmarkFilter
from naoimitate.live.sample import with_pelvis
from naoimitate.live.tpose import TPoseWatch


class Eye:
    """Sees one operator. filtered: landmarks are filtered. mirror: left and right are exchanged."""

    def __init__(self, filtered: bool = True, mirror: bool = False) -> None:
        self._filtered, self._mirror = filtered, mirror
        self._clock, self.filter, self._watch = SenderClock(), LandmarkFilter(), TPoseWatch()
        self.complaint = ""
        """Why the last T-pose that was held could not be used; empty where there is no such."""

    @property
    def countdown(self) -> float:
        """Seconds for which the T-pose still has to be held."""
        return self._watch.left

    def receive(self, frame: HumanFrame, arrival: float) -> HumanFrame:
        """A frame as it came, its time on the sender's clock (NaN: not told), put on our clock and completed."""
        frame = with_pelvis(replace(frame, time=self._clock.moment(frame.time, arrival)))
        return mirrored_frame(frame) if self._mirror else frame

    def look(self, frame: HumanFrame) -> HumanFrame:
        """The operator as they are, filtered."""
        return self.filter.step(frame) if self._filtered else frame

    def expected(self, person: HumanFrame, time: float) -> HumanFrame:
        """The operator last looked at, continued to a later time, s."""
        return self.filter.predicted(time, person) if self._filtered and time > person.time else person

    def measure(self, person: HumanFrame) -> Subject | None:
        """The operator's measures, once they have held a T-pose; one that cannot serve is waited out."""
        held = self._watch.see(person)
        if held is None:
            return None
        self.forget()
        try:
            subject = calibrate(held)
        except CalibrationError as error:
            self.complaint = str(error)
            return None
        self.complaint = ""
        return subject

    def forget(self) -> None:
        """Begin to wait for a T-pose anew."""
        self._watch.reset()
