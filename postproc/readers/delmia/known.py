"""What may stand in an OLP file: every element with its attributes, from files and their manual.

What is in no table may change anything, so it is refused by its name like a word of APT.
"""

from __future__ import annotations

from collections.abc import Callable

from lxml import etree

_XYZ, _YPR, _VALUE = "X Y Z Units", "Yaw Pitch Roll Units", "Value Units"
_SIGNAL = "SignalName SignalValue PortNumber Duration MaxWaitTime"
_WITH_ATTRIBUTES = {
    "OLPData": "DownloaderRootDirectory", "Resource": "ResourceType id", "MaxSpeed": "Units",
    "TCPPosition": _XYZ, "TCPOrientation": _YPR, "Mass": "MassValue Units",
    "CentroidPosition": "Cx Cy Cz Units", "Inertia": "Ixx Iyy Izz Ixy Iyz Izx Units",
    "Speed": _VALUE, "Accel": _VALUE, "AngularSpeedValue": _VALUE, "AngularAccelValue": _VALUE,
    "AccuracyValue": _VALUE, "ObjectFrameProfile": "ApplyOffsetToTags",
    "ObjectFrame": "ReferenceFrame", "ObjectFramePosition": _XYZ, "ObjectFrameOrientation": _YPR,
    "ActivityList": "Task", "Activity": "ActivityType Operation id", "Position": _XYZ,
    "Orientation": _YPR, "Target": "Default ViaPoint", "CartesianTarget": "Status",
    "Config": "Name", "Tag": "TagGroup", "Joint": "JointName JointType DOFNumber Units",
    "JointValue": "LowerTravelLimit UpperTravelLimit Status", "SetSignalAttributes": _SIGNAL,
    "SetSignal": _SIGNAL, "WaitSignalAttributes": _SIGNAL, "WaitSignal": _SIGNAL,
    "ActivityTime": "StartTime EndTime",
}  # fmt: skip
_PLAIN = (
    "GeneralInfo ResourceName NumberOfRobotAxes NumberOfAuxiliaryAxes NumberOfExternalAxes "
    "NumberOfPositionerAxes DownloadCoordinates SelectPartsOnUpload Platform Controller "
    "ToolProfileList CurrentToolProfile ToolProfile Name ToolType TCPOffset Centroid "
    "MotionProfileList CurrentMotionProfile MotionProfile MotionBasis AccuracyProfileList "
    "CurrentAccuracyProfile AccuracyProfile FlyByMode AccuracyType ObjectFrameProfileList "
    "CurrentObjectFrameProfile ParameterList AttributeList CallName DownloadStyle ActivityName "
    "OperationAttributeList MotionAttributes MotionType BaseWRTWorld JointTarget SignalName "
    "SignalValue PortNumber Duration MaxWaitTime StartTime EndTime"
)
_KNOWN = {name: frozenset(names.split()) for name, names in _WITH_ATTRIBUTES.items()}
_KNOWN |= dict.fromkeys(_PLAIN.split(), frozenset())
_ONLY = {
    "ApplyOffsetToTags": ("", "off"),
    "ToolType": ("", "onrobot"),
    "JointType": ("", "rotational", "translational"),
}
"""Values of what is read without being carried out: any other changes where the tool goes."""


class Strange:
    """Collects what is in no table.

    Args:
        found: lines by name, filled as elements are looked at.
        line_of: of an element.
    """

    def __init__(
        self, found: dict[str, list[int]], line_of: Callable[[etree._Element], int]
    ) -> None:
        self._found = found
        self._line_of = line_of

    def look(self, element: etree._Element) -> None:
        """Look at an element and all in it; what is in a strange one is not looked at."""
        tag = etree.QName(element).localname
        attributes = _KNOWN.get(tag)
        if attributes is None:
            self._note(tag, element)
            return
        for name, value in element.attrib.items():
            if str(name)[:1] == "{":  # of XML itself
                continue
            if name not in attributes or str(value).strip().lower() not in _ONLY.get(
                str(name), (str(value).strip().lower(),)
            ):
                self._note(str(name), element)
        if tag in _ONLY and (element.text or "").strip().lower() not in _ONLY[tag]:
            self._note(tag, element)
        for child in element:
            self.look(child)

    def _note(self, name: str, element: etree._Element) -> None:
        self._found.setdefault(name, []).append(self._line_of(element))
