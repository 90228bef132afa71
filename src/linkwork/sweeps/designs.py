"""Designs: which values the members of a study have. Each is a pure function of the study and the
member's number.

    grid    every combination of the levels, the last name varying fastest
    random  independent values x = F^-1(u), u from a counter-based generator (Philox), so that
            member i is i's alone
    sobol   the same with u from a scrambled Sobol sequence, which fills the space evenly; best with
            2^k members

Sources: Salmon et al., Parallel random numbers: as easy as 1, 2, 3 (2011); Owen, Scrambling Sobol'
and Niederreiter-Xing points (1998).
"""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Sequence
from math import prod
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from linkwork.mechanism.record import MechanismError, Positive, Real, Record

LANES = 4  # numbers that Philox gives for each value of its counter
TAIL = 1e-9  # probability beyond the bounds of a distribution without end
LEAST = 2.0**-54
MOST_SOBOL = 2**30


class Variation(Record, ABC):
    """Say which values something takes; also: other names that take the same value."""

    also: tuple[str, ...] = Field(default=(), description="other names that take the same values")

    @property
    @abstractmethod
    def bounds(self) -> tuple[float, float]:
        """The least and the largest value; of a distribution without end those it passes once in
        10^9 members."""

    @property
    def by_ratio(self) -> bool:
        """Whether equal ratios of positive values are equally far apart."""
        return False


class Distribution(Variation):
    """Vary at random."""

    @abstractmethod
    def at(self, u: np.ndarray) -> np.ndarray:
        """Return the quantiles F^-1(u), 0 < u < 1."""

    @property
    def bounds(self) -> tuple[float, float]:
        low, high = self.at(np.array([TAIL, 1 - TAIL])).tolist()
        return low, high


class Bounded(Distribution):
    """Vary between two ends."""

    low: Real = Field(description="the least value")
    high: Real = Field(description="the largest value")

    @property
    def bounds(self) -> tuple[float, float]:
        return self.low, self.high

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.low < self.high:
            raise MechanismError(
                f"low = {self.low:g} is not below high = {self.high:g}; give low < high"
            )
        return self


class Values(Distribution):
    """Take the values of a list: all of them in a grid, each equally likely at random."""

    type: Literal["values"] = "values"
    values: tuple[Real, ...] = Field(min_length=1, description="a list of numbers")

    @property
    def levels(self) -> np.ndarray:
        """The values."""
        return np.array(self.values)

    @property
    def bounds(self) -> tuple[float, float]:
        return min(self.values), max(self.values)

    def at(self, u: np.ndarray) -> np.ndarray:
        return self.levels[np.minimum((u * len(self.values)).astype(int), len(self.values) - 1)]


class Levels(Variation):
    """Take equally spaced values; spacing: "even", or "geometric" (equal ratios)."""

    type: Literal["levels"] = "levels"
    low: Real = Field(description="the first level")
    high: Real = Field(description="the last level")
    count: Annotated[int, Field(ge=2)] = Field(description="how many levels, at least 2")
    spacing: Literal["even", "geometric"] = Field(default="even", description="even or geometric")

    @property
    def levels(self) -> np.ndarray:
        """The values."""
        return (np.geomspace if self.spacing == "geometric" else np.linspace)(
            self.low, self.high, self.count
        )

    @property
    def bounds(self) -> tuple[float, float]:
        return min(self.low, self.high), max(self.low, self.high)

    @property
    def by_ratio(self) -> bool:
        return self.spacing == "geometric" and self.low > 0

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.low == self.high:
            raise MechanismError(f"low and high are both {self.low:g}; give two different ends")
        if self.spacing == "geometric" and self.low * self.high <= 0:
            raise MechanismError(
                "geometric levels need ends of one sign that are not zero; give others, or even "
                "spacing"
            )
        return self


class Uniform(Bounded):
    """Vary evenly between low and high."""

    type: Literal["uniform"] = "uniform"

    def at(self, u: np.ndarray) -> np.ndarray:
        return self.low + (self.high - self.low) * u


class LogUniform(Bounded):
    """Vary evenly in the logarithm between low and high, both positive."""

    type: Literal["log_uniform"] = "log_uniform"

    @property
    def by_ratio(self) -> bool:
        return True

    def at(self, u: np.ndarray) -> np.ndarray:
        return self.low * (self.high / self.low) ** u

    @model_validator(mode="after")
    def _positive(self) -> Self:
        if not self.low > 0:
            raise MechanismError(f"low = {self.low:g} has no logarithm; give positive ends")
        return self


class Triangular(Bounded):
    """Vary between low and high, most likely at mode, with a density that falls off linearly."""

    type: Literal["triangular"] = "triangular"
    mode: Real = Field(description="the most likely value")

    def at(self, u: np.ndarray) -> np.ndarray:
        a, b, c = self.low, self.high, self.mode
        rising = a + np.sqrt(u * (b - a) * (c - a))
        return np.where(u * (b - a) < c - a, rising, b - np.sqrt((1 - u) * (b - a) * (b - c)))

    @model_validator(mode="after")
    def _inside(self) -> Self:
        if not self.low <= self.mode <= self.high:
            raise MechanismError(
                f"mode = {self.mode:g} lies outside {self.low:g} to {self.high:g}; give one within"
            )
        return self


class Normal(Distribution):
    """Vary by Gauss's law with a mean and a standard deviation; cut off at low and high where these
    are given."""

    type: Literal["normal"] = "normal"
    mean: Real = Field(description="the mean")
    deviation: Positive = Field(description="the standard deviation, above 0")
    low: Real | None = Field(default=None, description="where it is cut off below")
    high: Real | None = Field(default=None, description="where it is cut off above")

    @property
    def ends(self) -> tuple[float, float]:
        """The ends in deviations from the mean."""
        low = -np.inf if self.low is None else self.low
        high = np.inf if self.high is None else self.high
        return (low - self.mean) / self.deviation, (high - self.mean) / self.deviation

    def at(self, u: np.ndarray) -> np.ndarray:
        low, high = self.ends
        with np.errstate(divide="ignore"):  # of 0, where a value is its end
            if low < 0:
                return self.mean + self.deviation * gaussian(np.log(u), low, high)
            return self.mean - self.deviation * gaussian(np.log1p(-u), -high, -low)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        from scipy.special import ndtr

        a, b = self.ends
        left, right = (a, b) if a < 0 else (-b, -a)
        if not ndtr(right) - ndtr(left) > 0:
            raise MechanismError(
                f"a normal distribution of mean {self.mean:g} and deviation {self.deviation:g} "
                f"has no values between low and high, {a:.3g} and {b:.3g} deviations from the "
                "mean; widen them"
            )
        return self


def gaussian(log_u: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return x with Phi(x) = Phi(low) + u (Phi(high) - Phi(low)), in logarithms, by which far tails
    are exact; low is negative."""
    from scipy.special import log_ndtr, ndtr, ndtri_exp  # scipy.stats takes a second to come

    below, most = log_ndtr(low), log_ndtr(high)
    if high > 0:
        between = np.log1p(-ndtr(low) - ndtr(-high))
    else:
        between = most + np.log(-np.expm1(below - most))
    return ndtri_exp(np.logaddexp(below, log_u + between))


class LogNormal(Distribution):
    """Vary by Gauss's law in the logarithm about a median; deviation: standard deviation of the
    natural logarithm."""

    type: Literal["log_normal"] = "log_normal"
    median: Positive = Field(description="the median, above 0")
    deviation: Positive = Field(
        description="the standard deviation of the natural logarithm, above 0"
    )

    @property
    def by_ratio(self) -> bool:
        return True

    def at(self, u: np.ndarray) -> np.ndarray:
        from scipy.special import ndtri

        return self.median * np.exp(self.deviation * ndtri(u))


AnyVariation = Annotated[
    Levels | Values | Uniform | LogUniform | Normal | LogNormal | Triangular,
    Field(discriminator="type"),
]


class Design(Record, ABC):
    """Give each point of a study its values."""

    @abstractmethod
    def count(self, variations: Sequence[Variation]) -> int:
        """Return the number of points."""

    @abstractmethod
    def refuse(self, name: str, variation: Variation) -> str:
        """Say why a variation does not fit this design; nothing if it does."""

    @abstractmethod
    def points(self, variations: Sequence[Variation], first: int, last: int) -> np.ndarray:
        """Return the values (last - first, variations) of the points from `first` to before
        `last`."""


class Grid(Design):
    """Take every combination of levels."""

    type: Literal["grid"] = "grid"

    def count(self, variations: Sequence[Variation]) -> int:
        return prod(len(levels(variation)) for variation in variations)

    def refuse(self, name: str, variation: Variation) -> str:
        return "" if hasattr(variation, "levels") else "a grid needs levels or values"

    def points(self, variations: Sequence[Variation], first: int, last: int) -> np.ndarray:
        axes = [levels(variation) for variation in variations]
        places = np.unravel_index(np.arange(first, last), [len(axis) for axis in axes])
        return np.stack([axis[place] for axis, place in zip(axes, places, strict=True)], axis=1)


def levels(variation: Variation) -> np.ndarray:
    """Return the levels of a variation that has them."""
    return variation.levels  # pyright: ignore[reportAttributeAccessIssue]


class Drawn(Design):
    """Take points of the unit cube through the quantiles of distributions."""

    members: Annotated[int, Field(ge=1)] = Field(description="number of points, at least 1")
    seed: Annotated[int, Field(ge=0)] = Field(
        default=0, description="seed of the random numbers, a whole number from 0 on"
    )

    def count(self, variations: Sequence[Variation]) -> int:
        return self.members

    def refuse(self, name: str, variation: Variation) -> str:
        return (
            ""
            if isinstance(variation, Distribution)
            else "levels are for a grid; give a distribution, or values"
        )

    def points(self, variations: Sequence[Variation], first: int, last: int) -> np.ndarray:
        u = np.maximum(self.cube(len(variations), first, last), LEAST)
        return np.stack(
            [variation.at(u[:, i]) for i, variation in enumerate(distributions(variations))], axis=1
        )

    @abstractmethod
    def cube(self, size: int, first: int, last: int) -> np.ndarray:
        """Return points (last - first, size) of the unit cube, 0 <= u < 1."""


def distributions(variations: Sequence[Variation]) -> list[Distribution]:
    """Return variations as what they are in a drawn design."""
    return [variation for variation in variations if isinstance(variation, Distribution)]


class Random(Drawn):
    """Draw independent values (Monte Carlo)."""

    type: Literal["random"] = "random"

    def cube(self, size: int, first: int, last: int) -> np.ndarray:
        blocks = -(-size // LANES)
        generator = np.random.Generator(np.random.Philox(key=self.seed, counter=first * blocks))
        return generator.random((last - first, blocks * LANES))[:, :size]


class Sobol(Drawn):
    """Draw from a scrambled Sobol sequence (quasi Monte Carlo)."""

    type: Literal["sobol"] = "sobol"
    members: Annotated[int, Field(ge=1, le=MOST_SOBOL)] = Field(
        description="number of points, 1 to 2^30; best a power of 2"
    )

    def cube(self, size: int, first: int, last: int) -> np.ndarray:
        from scipy.stats import qmc

        sequence = qmc.Sobol(size, scramble=True, rng=self.seed)
        if first:
            sequence.fast_forward(first)
        with warnings.catch_warnings():
            # Of counts that are no powers of two: a chunk is none.
            warnings.simplefilter("ignore", UserWarning)
            return sequence.random(last - first)


AnyDesign = Annotated[Grid | Random | Sobol, Field(discriminator="type")]
