"""Frames of further stations, places of further reflectors, ends of wires, planes touched."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import (
    Basis,
    Effect,
    Kind,
    Parameter,
    Setting,
    base_moved,
    point_moved,
    register,
)
from postproc.geometry import rotation_from_vector, transform
from postproc.model import Registration


@register
class SetUpFrames(Effect):
    """Shift and turn of each station but the first, shift of each reflector but the first.

    Only where a registration is fitted: there each set-up of the measuring device is free. And
    what rows are read against where that is not known: ends of wires and bars, planes.
    """

    name = "set_up_frames"
    of_several = True
    title = "stations and reflectors of the measuring device"
    source = "rigid registration of each station, place of each reflector"
    action = "measure common nests from every station"
    kind = Kind.REGISTRATION
    conditions = ("station",)
    geometric = True

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return shift [m], turn [rad] of stations, shift [m] of reflectors, then references."""
        del arm
        sizes = (("shift", 5e-4), ("turn", 3e-4))
        frames = tuple(
            Parameter(f"station_{s}_{what}_{axis}", size)
            for s in range(1, int(setting["stations"]))
            for what, size in sizes
            for axis in "xyz"
        )
        points = tuple(
            Parameter(f"reflector_{r}_{axis}", 5e-4)
            for r in range(1, int(setting["reflectors"]))
            for axis in "xyz"
        )
        references = int(setting.get("references", 0))
        return frames + points + tuple(Parameter(f"reference_{k}", 1e-3) for k in range(references))

    def prepare(self, samples: Samples) -> Setting:
        """Return how many stations, reflectors and numbers of references there are."""
        references = 0 if samples.references is None else samples.references.shape[2]
        stations, reflectors = 1, 1
        if samples.set_up is not None:
            stations, reflectors = (int(k) + 1 for k in samples.set_up.max(axis=0))
        return {"stations": stations, "reflectors": reflectors, "references": references}

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move frame 0 of the rows of a station, and the point beyond joint 6 of a reflector."""
        stations, reflectors = int(setting["stations"]), int(setting["reflectors"])
        n, references = len(samples), int(setting.get("references", 0))
        set_up = np.zeros((n, 2)) if samples.set_up is None else samples.set_up
        at_station, of_reflector = (
            np.asarray(set_up[:, k, None] == np.arange(1, count), dtype=np.float64)
            for k, count in enumerate((stations, reflectors))
        )
        moved = [base_moved(at_station), point_moved(samples, of_reflector)]
        link = np.concatenate([*moved, np.zeros((n, 7, 6, references))], axis=3)
        point = np.zeros((n, 3, link.shape[3]))
        if samples.references is not None and references:
            point[:, :, -references:] = samples.references
        return Basis(link=link, point=point)

    def registered(self, registration: Registration, theta: FloatArray) -> Registration:
        """Move the further stations and reflectors."""
        frames = 6 * max(len(registration.stations) - 1, 0)
        points = 3 * max(len(registration.reflectors) - 1, 0)
        turns = theta[:frames].reshape(-1, 6)
        shifts = theta[frames : frames + points].reshape(-1, 3)
        stations = dict(registration.stations)
        for name, x in zip(list(stations)[1:], turns, strict=True):
            stations[name] = stations[name] @ transform(rotation_from_vector(x[3:]), x[:3])
        reflectors: Mapping[str, FloatArray] = dict(registration.reflectors) | {
            name: registration.reflectors[name] + x
            for name, x in zip(list(registration.reflectors)[1:], shifts, strict=True)
        }
        return replace(registration, stations=stations, reflectors=reflectors)
