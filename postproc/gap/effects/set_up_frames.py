"""Frames of further stations, places of further reflectors, ends of wires, planes touched."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import Basis, Effect, Kind, Parameter, Setting, register
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
        frames, references = 6 * (stations - 1) + 3 * (reflectors - 1), samples.references
        size = frames + int(setting.get("references", 0))
        link, point = np.zeros((len(samples), 7, 6, size)), np.zeros((len(samples), 3, size))
        if references is not None and size > frames:
            point[:, :, frames:] = references
        if samples.set_up is None:
            return Basis(link=link, point=point)
        R_6_flange = samples.arm.link_constants()[2]
        for s in range(1, stations):
            here, at = samples.set_up[:, 0] == s, 6 * (s - 1)
            link[here, 0, 3:, at : at + 3] = np.eye(3)
            link[here, 0, :3, at + 3 : at + 6] = np.eye(3)
        for r in range(1, reflectors):
            here, at = samples.set_up[:, 1] == r, 6 * (stations - 1) + 3 * (r - 1)
            link[here, 6, 3:, at : at + 3] = R_6_flange
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
