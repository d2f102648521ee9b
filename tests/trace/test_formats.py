"""What controllers write: telegrams of RSI, DIAdem pairs of KUKA Trace, as they lay it out."""

import numpy as np
import pytest

from postproc.errors import DataError
from postproc.trace import TRACES, read_recording
from tests.trace.known import command, rows

TABLE = rows(command)[:900]


def telegrams(table):
    """As sent, by cycle stamps in ms that begin anywhere."""
    for row in table:
        parts = [
            f"<{name} " + " ".join(f'A{k + 1}="{v:.6f}"' for k, v in enumerate(values)) + "/>"
            for name, values in (("AIPos", row[7:13]), ("ASPos", row[1:7]))
        ]
        stamp = 4208163634 + round(1e3 * row[0])
        yield '<Rob Type="KUKA"><RIst X="1.0" Y="2.0"/>' + "".join(parts)
        yield f'<Delay D="0"/><IPOC>{stamp}</IPOC></Rob>'


def test_rsi(tmp_path):
    path = tmp_path / "rsi.log"
    path.write_text("\n".join(telegrams(TABLE)) + "\n", encoding="utf-8")
    found = read_recording(path)
    assert found.time - found.time[0] == pytest.approx(TABLE[:, 0], abs=1e-6)
    assert np.rad2deg(found.command) == pytest.approx(TABLE[:, 1:7], abs=2e-6)
    assert np.rad2deg(found.actual) == pytest.approx(TABLE[:, 7:13], abs=2e-6)
    path.write_text(path.read_text(encoding="utf-8").replace('A2="', 'A2="x', 1), encoding="utf-8")
    with pytest.raises(DataError, match="no number"):
        read_recording(path)


def diadem(folder, name, channels, time, shift=0.0):
    """A header and its raw numbers, samples interleaved, with factor and offset."""
    lines = ["#BEGINGLOBALHEADER", "101,x", "#ENDGLOBALHEADER"]
    lines += ["#BEGINCHANNELHEADER", "200,Zeit", "202,s", "210,IMPLIZIT", f"220,{len(time)}"]
    lines += [f"240,{shift!r}", f"241,{float(time[1] - time[0])!r}", "#ENDCHANNELHEADER"]
    raw = np.empty((len(time), len(channels)))
    for k, (title, values) in enumerate(channels.items()):
        raw[:, k] = (values - 3.0) / 2.0
        lines += ["#BEGINCHANNELHEADER", f"200,{title}", "202,°", "210,EXPLIZIT"]
        lines += [f"211,{name}.r64", "213,BLOCK", "214,REAL64", f"220,{len(time)}", f"221,{k + 1}"]
        lines += ["240,3.0", "241,2.0", "#ENDCHANNELHEADER"]
    (folder / f"{name}.dat").write_text("\n".join(lines) + "\n", encoding="cp1252")
    (folder / f"{name}.r64").write_bytes(raw.astype("<f8").tobytes())


def test_kuka_trace(tmp_path):
    time = TABLE[:, 0]
    for axis in range(6):
        # the third drive starts 40 ms later
        late = 10 if axis == 2 else 0
        channels = {
            "Positionsschleppfehler": np.zeros(len(time) - late),
            "Istposition": TABLE[late:, 7 + axis],
            "Sollposition": TABLE[late:, 1 + axis],
        }
        diadem(tmp_path, f"T1_NextGenDrive#{axis + 1}", channels, time[late:], 0.004 * late)
    found = read_recording(tmp_path / "T1_NextGenDrive#2.dat")
    assert len(found) == len(time) - 10
    assert np.rad2deg(found.command) == pytest.approx(TABLE[10:, 1:7], abs=1e-6)
    assert np.rad2deg(found.actual) == pytest.approx(TABLE[10:, 7:13], abs=1e-6)
    (tmp_path / "T1_NextGenDrive#4.dat").unlink()
    with pytest.raises(DataError, match="q4_cmd_deg"):
        read_recording(tmp_path / "T1_NextGenDrive#2.dat")
    (tmp_path / "T1_NextGenDrive#3.r64").write_bytes(b"1234567890")
    with pytest.raises(DataError, match="values of channel"):
        read_recording(tmp_path / "T1_NextGenDrive#2.dat")


def test_every_format_is_tried_here():
    assert {name for name, _ in TRACES} == {"csv", "rsi", "kuka_trace"}
