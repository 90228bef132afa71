"""The clock of a run that is played: pure, it is told how much time has passed."""

from __future__ import annotations

from dataclasses import dataclass, replace

SPEEDS = ("1/50", "1/10", "1/4", "1/2", "1", "2", "5", "10")


@dataclass(frozen=True)
class Player:
    """Hold where a run stands.

    start, end: of the run [s]; time: now [s]; speed: run seconds per second; playing; looping:
    begin anew at the end
    """

    start: float = 0.0
    end: float = 0.0
    time: float = 0.0
    speed: float = 1.0
    playing: bool = False
    looping: bool = False

    @classmethod
    def of(cls, start: float, end: float) -> Player:
        """Return a clock at the start of a run."""
        return cls(start, end, start)

    @property
    def ended(self) -> bool:
        """Tell whether the run stands at its end."""
        return self.time >= self.end

    def advanced(self, seconds: float) -> Player:
        """Return the clock after some seconds; at the run's end it stops there, or begins anew."""
        if not self.playing:
            return self
        time = self.time + self.speed * seconds
        if time < self.end:
            return replace(self, time=time)
        length = self.end - self.start
        if self.looping and length > 0:
            return replace(self, time=self.start + (time - self.start) % length)
        return replace(self, time=self.end, playing=False)

    def toggled(self) -> Player:
        """Play or pause; at its end a run is played from the start. A run of one instant stands
        still."""
        if self.playing or not self.end > self.start:
            return replace(self, playing=False)
        return replace(self, playing=True, time=self.start if self.ended else self.time)

    def at(self, time: float) -> Player:
        """Go to a time [s], kept within the run."""
        return replace(self, time=min(max(time, self.start), self.end))

    def at_speed(self, name: str) -> Player:
        """Play at one of `SPEEDS`."""
        whole, _, part = name.partition("/")
        return replace(self, speed=float(whole) / float(part or 1))
