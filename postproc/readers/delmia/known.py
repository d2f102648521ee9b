"""What may stand in an OLP file: every element with its attributes, from files and their manual.

What is in no table may change anything, so it is refused by its name like a word of APT.
"""

from __future__ import annotations

from collections.abc import Iterator

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


def strange(element: etree._Element) -> Iterator[tuple[str, etree._Element]]:
    """Yield what is in no table of an element and all in it, by name; not what is in it in turn."""
    tag = etree.QName(element).localname
    attributes = _KNOWN.get(tag)
    if attributes is None:
        yield tag, element
        return
    for name, value in element.attrib.items():
        text = str(value).strip().lower()
        of_xml = str(name)[:1] == "{"
        if not of_xml and (name not in attributes or text not in _ONLY.get(str(name), (text,))):
            yield str(name), element
    if tag in _ONLY and (element.text or "").strip().lower() not in _ONLY[tag]:
        yield tag, element
    for child in element:
        yield from strange(child)
